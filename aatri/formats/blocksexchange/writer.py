"""Writing of an oriented block as BlocksExchange XML, version 2.1; the form is that of `reader`.

Cameras are photogroups with K1 K2 K3 P1 P2; control and check points keep their names, roles and standard deviations
(one for east and north), tie points their coordinates and image points, not their names.
"""

from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from aatri.formats.conventions.lens import Lens
from aatri.formats.conventions.lens_conversion import as_program_states
from aatri.formats.conventions.poses import stated_rotation
from aatri.formats.parts.format import AS_USUAL, Writing
from aatri.formats.results.exported_files import ControlPoint, control_points
from aatri.formats.results.oriented_block import OrientedBlock
from aatri.formats.text.written_files import element, write_files, xml_of
from aatri.ids import several, shown
from aatri.progress import SILENT, Reporter

NAME = "block.xml"
CATEGORY = {(True, True, True): "Full", (True, True, False): "Horizontal", (False, False, True): "Vertical"}


def write_blocksexchange(
    oriented: OrientedBlock, folder: Path, writing: Writing = AS_USUAL, reporter: Reporter = SILENT
) -> None:
    """Write `block.xml`."""
    block, crs = oriented.block, str(oriented.block.frames.crs[0])
    systems, number = [], []
    if crs != "local":
        srs = element("SRS", element("Id", 1), element("Name", crs), element("Definition", crs))
        systems, number = [element("SpatialReferenceSystems", srs)], [element("SRSId", 1)]
    groups = []
    for k, stated in enumerate(oriented.lenses):
        lens = as_program_states(stated, ["blocksexchange"], reporter, allowed_px=writing.lens_misfit_px)
        photos = [_photo(oriented, row) for row in np.flatnonzero(block.images.camera == k).tolist()]
        groups.append(_photogroup(lens, photos))
    xy_px = oriented.from_corner_px(oriented.rays) - 0.5  # from the centre of the first pixel
    measured = [
        element("Measurement", element("PhotoId", image), *_place(xy))
        for image, xy in zip(oriented.rays.image.tolist(), xy_px.tolist())
    ]
    marks = {point: [measured[k] for k in rows] for point, rows in oriented.rays.of_points().items()}
    points = control_points(oriented)
    written = [p for p in points if p.known in CATEGORY]
    if strange := [p.id for p in points if p.known not in CATEGORY]:
        reporter.warn(f"control of one plan coordinate has no category, and is left out: {shown(strange)}")
    if unlike := [p.id for p in written if p.known[0] and p.sigma_m[0] != p.sigma_m[1]]:
        reporter.log(f"sigmas of east and north become their quadratic mean: {shown(unlike)}")
    control = [_control(p, marks.get(p.row, []), number) for p in written]
    of_control = {p.row for p in written}
    ties = [_tie(oriented, row, of_point) for row, of_point in marks.items() if row not in of_control]
    parts = [element("Photogroups", *groups), element("ControlPoints", *control), element("TiePoints", *ties)]
    body = element("Block", element("Name", block.name), element("Type", "Aerial"), *number, *parts)
    write_files(folder, {NAME: xml_of(element("BlocksExchange", *systems, body, version="2.1"))})
    if ties:
        reporter.log(
            f"{several(len(ties), 'tie point', 'is', 'are')} written without their names, which the "
            "format does not have"
        )


def _photogroup(lens: Lens, photos: list[ET.Element]) -> ET.Element:
    width, height = lens.size_px
    x, y = lens.principal_point_px
    return element(
        "Photogroup",
        element("Name", lens.id),
        element("ImageDimensions", element("Width", int(width)), element("Height", int(height))),
        element("CameraModelType", "Perspective"),
        element("SensorSize", max(width, height) * lens.pixel_mm),
        element("FocalLengthPixels", lens.focal_px[0]),
        element("CameraOrientation", "XRightYDown"),
        element("PrincipalPoint", element("x", (width - 1) / 2 + x), element("y", (height - 1) / 2 + y)),
        element("Distortion", *(element(name, value) for name, value in lens.parameters.items())),
        element("AspectRatio", 1),
        element("Skew", 0),
        *photos,
    )


def _photo(oriented: OrientedBlock, row: int) -> ET.Element:
    photo = element("Photo", element("Id", row), element("ImagePath", str(oriented.block.images.id[row])))
    photo.append(element("Component", 0 if oriented.oriented[row] else 1))
    pose = []
    if oriented.oriented[row]:
        M = stated_rotation(oriented.ground_from_image[row], "blocksexchange")
        pose = [element("Rotation", *(element(f"M_{i}{j}", M[i, j]) for i in range(3) for j in range(3)))]
    if np.isfinite(oriented.position_m[row]).all():
        photo.append(element("Pose", *pose, _xyz("Center", oriented.position_m[row].tolist())))
    return photo


def _place(coordinates: list[float]) -> list[ET.Element]:
    return [element(axis, value) for axis, value in zip("xyz", coordinates)]


def _xyz(tag: str, xyz: list[float]) -> ET.Element:
    return element(tag, *_place(xyz))


def _control(p: ControlPoint, measurements: list[ET.Element], number: list[ET.Element]) -> ET.Element:
    across = float(np.sqrt(np.mean(p.sigma_m[:2] ** 2)))
    sigma = [("HorizontalAccuracy", across, p.known[0]), ("VerticalAccuracy", float(p.sigma_m[2]), p.known[2])]
    return element(
        "ControlPoint",
        *number,
        element("Name", p.id),
        element("Category", CATEGORY[p.known]),
        element("CheckPoint", "true" if p.is_check else "false"),
        _xyz("Position", np.nan_to_num(p.xyz_m).tolist()),
        *(element(tag, value) for tag, value, is_known in sigma if is_known and value > 0),
        *measurements,
    )


def _tie(oriented: OrientedBlock, row: int, measurements: list[ET.Element]) -> ET.Element:
    xyz = oriented.xyz_m[row]
    position = [_xyz("Position", xyz.tolist())] if np.isfinite(xyz).all() else []
    return element("TiePoint", *position, *measurements)
