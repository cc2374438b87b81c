"""Cameras of BlocksExchange XML: their axes, the rotations that a file states.

`CameraOrientation` names where x and y of the camera point in the image; z completes them to a right-handed system, and
is ahead where it is that of `XRightYDown`. M turns ground to these axes and is given by its nine elements, by angles

    omega, phi, kappa    M = (Rx(omega) Ry(phi) Rz(kappa))'
    yaw, pitch, roll     R = Rz(-yaw) Rx(pitch) Ry(-roll) Rx(90 deg): at 0 0 0 the camera looks along Y, its x along X

in degrees, R from camera axes x right, y up to the ground. What of it is open is tried by points of the file (`ways`).

Sources: Bentley, description of BlocksExchange 2.1, where one rotation stands as matrix and as omega, phi, kappa;
ContextCapture User Guide, perspective camera model (sense of yaw, pitch, roll).
"""

from collections.abc import Callable

import numpy as np

from aatri.arrays import Float
from aatri.formats.blocksexchange.points import points_of
from aatri.formats.blocksexchange.ways import USUAL, Affinity, Way, affinity, decided, misfits_px, ways_of
from aatri.formats.conventions.lens import Lens
from aatri.formats.conventions.pixel_origins import PIXEL_MM
from aatri.formats.conventions.poses import Y_UP, ground_from_image, is_rotation
from aatri.formats.text.xml_tree import XmlElement
from aatri.geometry.rotations import rotation_from_angles
from aatri.ids import clipped, several

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

DISTORTION = ("K1", "K2", "K3", "P1", "P2")
XYZ = ("x", "y", "z")


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


def lens_of(group: XmlElement, number: int, way: Way) -> Lens:
    """The camera of a photogroup; it is called by its name, where that is there."""
    name = group.optional("Name")
    kind = group.optional("CameraModelType")
    if kind is not None and kind.text != "Perspective":
        raise kind.error(f"the camera model {clipped(kind.text)!r} has no like here", "a Perspective one is wanted")
    width, height, f, pixel_mm = _size(group)
    offset = (_principal_point(group) - _image_centre(group)).tolist()
    distortion = group.optional("Distortion")
    for other in distortion.children if distortion is not None else ():
        if other.tag not in DISTORTION and (other.tag, other.text) != ("Direct", "true"):
            what = f"{other.tag} {clipped(other.text)} of a distortion is not read"
            raise other.error(what, f"export {', '.join(DISTORTION)}, from ideal to measured coordinates")
    parameters = {k: distortion.number(k, default=0.0) for k in DISTORTION} if distortion is not None else {}
    id_ = name.text if name is not None and name.text else f"photogroup {number}"
    affine = affinity(group, height, f)
    form, focal = "blocksexchange", affine.focal_px(f, way)
    if affine != Affinity(1.0, 0.0):
        form, parameters = "blocksexchange-affine", {**parameters, "shear": affine.shear(f, way)}
    return Lens(id_, form, (width, height), focal, tuple(offset), parameters, pixel_mm=pixel_mm, where=group.where)


def _image_centre(group: XmlElement) -> Float:
    width, height, _, _ = _size(group)
    return np.array([(width - 1) / 2, (height - 1) / 2])


def _principal_point(group: XmlElement) -> Float:
    """Column and row of the principal point, px; that of the image centre where none is stated."""
    stated = group.optional("PrincipalPoint")
    return _image_centre(group) if stated is None else pixels_of(stated, group, _image_centre)


def pixels_of(
    place: XmlElement, group: XmlElement, origin_px: Callable[[XmlElement], Float] = _principal_point
) -> Float:
    """Column and row of x, y; of xmm, ymm, along the axes of the camera from its principal point or another origin."""
    if place.optional("xmm") is None:
        return np.array([place.number("x"), place.number("y")])
    mm = np.array([place.number("xmm"), place.number("ymm")])
    return np.asarray(origin_px(group) + axes_of(group)[:2, :2] @ mm / _size(group)[3])


def _size(group: XmlElement) -> tuple[float, float, float, float]:
    """Width and height, px, focal length, px, and the size of a pixel, mm."""
    width, height = (group.number("ImageDimensions", side) for side in ("Width", "Height"))
    sensor = group.number("SensorSize", default=0.0)  # its longer side
    pixel_mm = group.number("PixelSize", default=sensor / max(width, height, 1.0))
    f = group.number("FocalLengthPixels", default=0.0)
    if not f and pixel_mm > 0:
        f = group.number("FocalLength") / pixel_mm
    if min(width, height, f) <= 0:
        raise group.error(f"image {width:g} x {height:g}, focal length {f:g} px", "give FocalLength and SensorSize")
    return width, height, f, pixel_mm if pixel_mm > 0 else PIXEL_MM


def open_ways(groups: list[XmlElement]) -> list[Way]:
    """The ways in which the file can be read."""
    sizes = [_size(group) for group in groups]
    affinities = [affinity(group, height, f) for group, (_, height, f, _) in zip(groups, sizes)]
    rotations = [pose for group in groups for pose in group.all("Photo", "Pose", "Rotation")]
    return ways_of(affinities, has_angles=any(r.optional("M_00") is None for r in rotations))


def way_of(block: XmlElement, groups: list[XmlElement], *, geographic: bool) -> tuple[Way, str]:
    """The way in which its measured points are where it projects them, and what is to be said of it."""
    ways = open_ways(groups)
    if len(ways) == 1 and ways[0] == USUAL:
        return USUAL, ""
    marks = {} if geographic else _marks(block)
    medians, count = list[float](), 0
    for way in ways:
        off = list[Float]()
        for k, group in enumerate(groups, 1):
            lens, axes = lens_of(group, k, way), axes_of(group)
            for photo in group.all("Photo"):
                of_photo = marks.get(photo.one("Id").text)
                if of_photo and photo.all("Pose", "Center") and photo.all("Pose", "Rotation"):
                    ground = np.array([xyz(position) for position, _ in of_photo])
                    measured = np.array([pixels_of(mark, group) for _, mark in of_photo])
                    R, centre = rotation_of(photo.one("Pose"), axes, way), np.array(xyz(photo.one("Pose", "Center")))
                    off.append(misfits_px(lens, R, centre, ground, measured))
        count = sum(map(len, off))
        medians.append(float(np.median(np.concatenate(off))) if off else np.inf)
    best = decided(medians, count)
    if best is not None:
        return ways[best], f"{ways[best]}: so its own measured points are where it projects them"
    far = f", the best {min(medians):.3g} px off" if count else ""
    more = f"{several(count, 'measured point')} of posed photos do not show which{far}"
    if {(way.aspect, way.skew) for way in ways} == {(USUAL.aspect, USUAL.skew)}:
        return USUAL, f"angles of rotations read as the format describes them, one of two ways: {more}"
    what = f"AspectRatio or Skew, which can be read in several ways: {more}"
    raise groups[0].error(what, "export with AspectRatio 1 and Skew 0, or the tie points too")


def _marks(block: XmlElement) -> dict[str, list[tuple[XmlElement, XmlElement]]]:
    """Positions of the system of the block and where they were measured, by the id of the photo."""
    marks = dict[str, list[tuple[XmlElement, XmlElement]]]()
    own = block.optional("SRSId")
    for kind in ("ControlPoint", "TiePoint"):
        for _, point, system in points_of(block, kind):
            position, category = point.optional("Position"), point.optional("Category")
            is_full = category is None or category.text == "Full"
            in_own = system is own or (system is not None and own is not None and system.text == own.text)
            if position is not None and is_full and in_own:
                for mark in point.all("Measurement"):
                    marks.setdefault(mark.one("PhotoId").text, []).append((position, mark))
    return marks


def xyz(element: XmlElement) -> list[float]:
    """Three coordinates."""
    return [element.number(axis) for axis in XYZ]
