"""Cameras of BlocksExchange XML, and the way in which the file is read where that is open (`ways`)."""

from collections.abc import Callable

import numpy as np

from aatri.arrays import Float
from aatri.formats.blocksexchange.axes import axes_of, rotation_of
from aatri.formats.blocksexchange.points import points_of
from aatri.formats.blocksexchange.ways import USUAL, Affinity, Way, affinity, decided, misfits_px, ways_of
from aatri.formats.conventions.lens import Lens
from aatri.formats.conventions.pixel_origins import PIXEL_MM
from aatri.formats.text.xml_tree import XmlElement
from aatri.ids import clipped, several

DISTORTION = ("K1", "K2", "K3", "P1", "P2")
XYZ = ("x", "y", "z")


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
