"""Axes of cameras in BlocksExchange XML, and the rotations that a file states.

`CameraOrientation` names where x and y of the camera point in the image; z completes them to a right-handed system, and
is ahead where it is that of `XRightYDown`. M turns ground to these axes and is given by its nine elements, by angles

    omega, phi, kappa    M = (Rx(omega) Ry(phi) Rz(kappa))'
    yaw, pitch, roll     R = Rz(-yaw) Rx(pitch) Ry(-roll) Rx(90 deg): at 0 0 0 the camera looks along Y, its x along X

in degrees, R from camera axes x right, y up to the ground. What of it is open is tried by points of the file (`ways`).

Sources: Bentley, description of BlocksExchange 2.1, where one rotation stands as matrix and as omega, phi, kappa;
ContextCapture User Guide, perspective camera model (sense of yaw, pitch, roll).
"""

import numpy as np

from aatri.arrays import Float
from aatri.formats.blocksexchange.ways import Way
from aatri.formats.conventions.poses import Y_UP, ground_from_image, is_rotation
from aatri.formats.text.xml_tree import XmlElement
from aatri.geometry.rotations import rotation_from_angles
from aatri.ids import clipped

IN_IMAGE = {"Right": (1.0, 0.0, 0.0), "Left": (-1.0, 0.0, 0.0), "Down": (0.0, 1.0, 0.0), "Up": (0.0, -1.0, 0.0)}
"""Directions in the axes of `XRightYDown`."""
ORIENTATIONS = {
    f"X{x}Y{y}": np.column_stack([IN_IMAGE[x], IN_IMAGE[y], np.cross(IN_IMAGE[x], IN_IMAGE[y])])
    for x in IN_IMAGE
    for y in IN_IMAGE
    if np.cross(IN_IMAGE[x], IN_IMAGE[y]).any()
}
"""Columns: the axes x, y, z of a CameraOrientation in those of `XRightYDown`."""
USUAL_AXES = "XRightYDown"
OPK, YPR = ("Omega", "Phi", "Kappa"), ("Yaw", "Pitch", "Roll")
LOOKS_AHEAD = rotation_from_angles(np.radians([[90.0, 0.0, 0.0]]))[0]


def axes_of(group: XmlElement) -> Float:
    """The axes of a photogroup (3, 3), a column of `ORIENTATIONS` each."""
    stated = group.optional("CameraOrientation")
    name = USUAL_AXES if stated is None else stated.text
    if stated is not None and name not in ORIENTATIONS:
        raise stated.error(f"CameraOrientation {clipped(name)!r}", f"known are {', '.join(ORIENTATIONS)}")
    return ORIENTATIONS[name]


def rotation_of(pose: XmlElement, axes: Float, way: Way) -> Float:
    """Image to ground, y up, of a pose in the axes of its photogroup; NaN where it has none."""
    rotation = pose.optional("Rotation")
    if rotation is None:
        return np.full((3, 3), np.nan)
    if rotation.optional(YPR[0]) is not None:
        yaw, pitch, roll = np.radians([rotation.number(name) for name in YPR])
        turned = roll if way.angles == "other" else -roll
        turns = rotation_from_angles([[0.0, 0.0, -yaw], [pitch, turned, 0.0]])
        return np.asarray(turns[0] @ turns[1] @ LOOKS_AHEAD)
    if rotation.optional("M_00") is not None:
        M = np.array([[rotation.number(f"M_{i}{j}") for j in range(3)] for i in range(3)])
        if not is_rotation(M):
            raise rotation.error("the matrix is no rotation", "export it again")
    elif rotation.optional(OPK[0]) is not None:
        R = rotation_from_angles(np.radians([[rotation.number(name) for name in OPK]]))[0]
        if way.angles == "other":
            R = R * Y_UP @ axes
        M = R.T
    else:
        what = f"a rotation of {clipped(', '.join(child.tag for child in rotation.children) or 'nothing', 60)}"
        raise rotation.error(what, f"export M_00 ... M_22, {', '.join(OPK)} or {', '.join(YPR)}")
    return ground_from_image(axes @ M, "blocksexchange")
