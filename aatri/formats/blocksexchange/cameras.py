"""Cameras and rotations of BlocksExchange XML, and the way in which the file is read where that is open (`ways`)."""

import numpy as np

from aatri.arrays import Float
from aatri.formats.blocksexchange.ways import USUAL, Affinity, Way, affinity, decided, misfits_px, ways_of
from aatri.formats.conventions.lens import Lens
from aatri.formats.conventions.pixel_origins import PIXEL_MM
from aatri.formats.conventions.poses import Y_UP, ground_from_image, is_rotation
from aatri.formats.text.xml_tree import XmlElement
from aatri.geometry.rotations import rotation_from_angles
from aatri.ids import clipped, several

DISTORTION = ("K1", "K2", "K3", "P1", "P2")
XYZ = ("x", "y", "z")


def lens_of(group: XmlElement, number: int, way: Way) -> Lens:
    """The camera of a photogroup; it is called by its name, where that is there."""
    name = group.optional("Name")
    kind = group.optional("CameraModelType")
    if kind is not None and kind.text != "Perspective":
        raise kind.error(f"the camera model {clipped(kind.text)!r} has no like here", "a Perspective one is wanted")
    width, height, f, sensor = _size(group)
    point = group.optional("PrincipalPoint")
    offset = (0.0, 0.0)
    if point is not None:
        offset = (point.number("x") - (width - 1) / 2, point.number("y") - (height - 1) / 2)
    distortion = group.optional("Distortion")
    parameters = {k: distortion.number(k, default=0.0) for k in DISTORTION} if distortion is not None else {}
    pixel_mm = sensor / max(width, height) if sensor > 0 else PIXEL_MM
    id_ = name.text if name is not None and name.text else f"photogroup {number}"
    affine = affinity(group, height, f)
    form, focal = "blocksexchange", affine.focal_px(f, way)
    if affine != Affinity(1.0, 0.0):
        form, parameters = "blocksexchange-affine", {**parameters, "shear": affine.shear(f, way)}
    return Lens(id_, form, (width, height), focal, offset, parameters, pixel_mm=pixel_mm, where=group.where)


def _size(group: XmlElement) -> tuple[float, float, float, float]:
    """Width and height, px, focal length, px, longer side of the sensor, mm, or 0."""
    width, height = (group.number("ImageDimensions", side) for side in ("Width", "Height"))
    sensor = group.number("SensorSize", default=0.0)
    f = group.number("FocalLengthPixels", default=0.0)
    if not f and sensor > 0:
        f = group.number("FocalLength") * max(width, height) / sensor
    if min(width, height, f) <= 0:
        raise group.error(f"image {width:g} x {height:g}, focal length {f:g} px", "give FocalLength and SensorSize")
    return width, height, f, sensor


def open_ways(groups: list[XmlElement]) -> list[Way]:
    """The ways in which the file can be read."""
    sizes = [_size(group) for group in groups]
    affinities = [affinity(group, height, f) for group, (_, height, f, _) in zip(groups, sizes)]
    rotations = [pose for group in groups for pose in group.all("Photo", "Pose", "Rotation")]
    return ways_of(affinities, has_angles=any(r.optional("M_00") is None for r in rotations))


def way_of(block: XmlElement, groups: list[XmlElement], *, geographic: bool) -> Way:
    """The way in which its measured points are where it projects them."""
    ways = open_ways(groups)
    if len(ways) == 1 and ways[0] == USUAL:
        return USUAL
    own = block.optional("SRSId")
    points = [*block.all("ControlPoints", "ControlPoint"), *block.all("TiePoints", "TiePoint")]
    marks = dict[str, list[tuple[list[float], list[float]]]]()
    for point in () if geographic else points:
        position, system = point.optional("Position"), point.optional("SRSId")
        kind = point.optional("Category")
        if kind is not None and kind.text != "Full":
            continue
        if position is None or (system is not None and (own is None or system.text != own.text)):
            continue
        for mark in point.all("Measurement"):
            xy = [mark.number("x"), mark.number("y")]
            marks.setdefault(mark.one("PhotoId").text, []).append((xyz(position), xy))
    medians, count = list[float](), 0
    for way in ways:
        off = list[Float]()
        for k, group in enumerate(groups, 1):
            lens = lens_of(group, k, way)
            for photo in group.all("Photo"):
                of_photo = marks.get(photo.one("Id").text)
                if of_photo and photo.all("Pose", "Center") and photo.all("Pose", "Rotation"):
                    ground, measured = (np.array(column) for column in zip(*of_photo))
                    R, centre = rotation_of(photo.one("Pose"), group, way), np.array(xyz(photo.one("Pose", "Center")))
                    off.append(misfits_px(lens, R, centre, ground, measured))
        count = sum(map(len, off))
        medians.append(float(np.median(np.concatenate(off))) if off else np.inf)
    best = decided(medians, count)
    if best is None:
        far = f", the best {min(medians):.3g} px off" if count else ""
        what = "AspectRatio, Skew or angles of rotations, which can be read in several ways"
        more = f"{several(count, 'measured point')} of posed photos do not show which{far}"
        raise groups[0].error(f"{what}: {more}", "export matrices, AspectRatio 1 and Skew 0, or the tie points too")
    return ways[best]


def rotation_of(pose: XmlElement, group: XmlElement, way: Way) -> Float:
    """Image to ground, y up."""
    axes = group.optional("CameraOrientation")
    if axes is not None and axes.text not in ("XRightYDown", "XRightYUp"):
        raise axes.error(f"CameraOrientation {clipped(axes.text)!r}", "export with XRightYDown")
    rotation = pose.optional("Rotation")
    if rotation is None:
        return np.full((3, 3), np.nan)
    y_up = axes is not None and axes.text == "XRightYUp"
    if rotation.optional("M_00") is None:
        R = rotation_from_angles(np.radians([[rotation.number(name) for name in ("Omega", "Phi", "Kappa")]]))[0]
        return np.asarray(R if y_up or way.angles == "y up" else R * Y_UP)
    M = np.array([[rotation.number(f"M_{i}{j}") for j in range(3)] for i in range(3)])
    if not is_rotation(M):
        raise rotation.error("the matrix is no rotation", "export it again")
    ours = ground_from_image(M, "blocksexchange")
    return np.asarray(ours * Y_UP) if y_up else ours


def xyz(element: XmlElement) -> list[float]:
    return [element.number(axis) for axis in XYZ]
