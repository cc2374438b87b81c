"""Reading of BlocksExchange XML (.xml, .xmlz), versions 2.1 to 3.2: cameras, poses, control, check and tie points.

Pixels and principal point count from the centre of the first pixel; `xmm`, `ymm` count from the image centre or the
principal point, along the axes of the camera (`cameras`). The distortion is forward, in normalised coordinates:

    u' = u (1 + K1 r^2 + K2 r^4 + K3 r^6) + 2 P2 u v + P1 (r^2 + 2 u^2),   v' likewise with P1 and P2 exchanged

AspectRatio, Skew and angles are read in the way that the points of the file show (`ways`). An image is called by its
file name, by its whole path where that stands for two; a photogroup by its name, with its number where two have one.
Poses are start values. A point is in the system of its own SRSId, of the list that it is in, or of the block, and
converted to that of the block; `ENU:latitude,longitude` is a plane of its own.

Source: Bentley, CC Orientations (BlocksExchange) format description.
"""

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from aatri.codes import APPROXIMATE, CHECK, CONTROL, NO_ROLE
from aatri.formats.blocksexchange.cameras import XYZ, axes_of, lens_of, pixels_of, rotation_of, way_of, xyz
from aatri.formats.blocksexchange.points import add_tie_points, points_of
from aatri.formats.blocksexchange.writer import write_blocksexchange
from aatri.formats.conventions.lens_conversion import camera_parts
from aatri.formats.parts.block_parts import LOCAL, PLANE, BlockParts
from aatri.formats.parts.format import AS_IT_SAYS, Format, Reading
from aatri.formats.parts.one_frame import in_frame
from aatri.formats.text.text_line import check_positive, once, places
from aatri.formats.text.xml_tree import XmlElement, read_xml
from aatri.frames.conversion import Frame
from aatri.ids import clipped, several, shown
from aatri.progress import SILENT, Reporter

VERSIONS = ("2.1", "3.0", "3.1", "3.2")
CATEGORIES = {"Full": (True, True, True), "Horizontal": (True, True, False), "Vertical": (False, False, True)}
"""Which coordinates of a control point are known."""


class _Photo(NamedTuple):
    """A photo: the name of its image, and its photogroup."""

    name: str
    group: XmlElement


def read_blocksexchange(path: Path, reading: Reading = AS_IT_SAYS, reporter: Reporter = SILENT) -> BlockParts:
    """Read a block.

    Raises
    ------
    InputError
        If the file is not of this form, or has what is not supported; the message names line and element.
    """
    root = read_xml(path, ("BlocksExchange",), "BlocksExchange XML")
    if (version := root.get("version")) not in VERSIONS:
        raise root.error(f"version {clipped(version)!r}", f"versions {', '.join(VERSIONS)} are read: export anew")
    blocks = root.all("Block")
    if len(blocks) > 1:
        named = shown([name.text for element in blocks for name in element.all("Name")])
        raise blocks[1].error(f"{len(blocks)} blocks: {named}", "export the one that is to be read")
    block = root.one("Block")
    every = block.all("Photogroups", "Photogroup")
    groups = [group for group in every if group.all("Photo")]
    if not groups:
        raise block.error("no Photogroup with photos", "export the block with its photos")
    tie_files, absent = add_tie_points(block, path)
    frame = _frame(root, block)
    way, of_way = way_of(block, groups, geographic=frame.geographic)
    lenses = [lens_of(group, k, way) for k, group in enumerate(groups, 1)]
    ids = [lens.id for lens in lenses]
    lenses = [
        replace(lens, id=f"{lens.id} {k}") if lens.id in ids[: k - 1] else lens for k, lens in enumerate(lenses, 1)
    ]
    parts = BlockParts(
        "blocksexchange",
        [path, *tie_files],
        name=path.stem,
        frame=frame,
        **camera_parts(lenses, reporter, allowed_px=reading.lens_misfit_px),
    )
    if len(groups) < len(every):
        parts.notes.append(f"{several(len(every) - len(groups), 'photogroup')} without photos not read")
    if absent:
        parts.notes.append(f"tie points are not read: {shown(absent)} is not beside the file")
    if of_way:
        parts.notes.append(of_way)
    if frame is PLANE:
        parts.notes.append("its system is a plane at a place of its own (ENU), taken as a local one")
    parts.cameras = {**parts.cameras, "pixel_origin": "top-left-centre"}
    photos = [(photo, lens.id, group) for lens, group in zip(lenses, groups) for photo in group.all("Photo")]
    names = _names([photo for photo, _, _ in photos])
    of_id = {photo.one("Id").text: _Photo(name, group) for (photo, _, group), name in zip(photos, names)}
    parts.images = {
        "id": names,
        "camera": [camera for _, camera, _ in photos],
        **places([p for p, _, _ in photos], [path]),
    }
    axes = {lens.id: axes_of(group) for lens, group in zip(lenses, groups)}
    posed = [(name, photo, axes[c]) for (photo, c, _), name in zip(photos, names) if photo.all("Pose", "Center")]
    if posed:
        parts.exterior = {
            "image": [name for name, _, _ in posed],
            "position_m": [xyz(photo.one("Pose", "Center")) for _, photo, _ in posed],
            "ground_from_image": [rotation_of(photo.one("Pose"), of_group, way) for _, photo, of_group in posed],
            **places([photo for _, photo, _ in posed], [path]),
        }
    _give_points(parts, block, of_id, root, reporter)
    if unread := [name for (photo, _, _), name in zip(photos, names) if photo.all("Pose", "Metadata")]:
        parts.notes.append(
            f"positions in the metadata of {several(len(unread), 'photo')} are not read: {shown(unread)}"
        )
    return parts


def _frame(root: XmlElement, block: XmlElement) -> Frame:
    """The system of the block; a free one without."""
    number = block.optional("SRSId")
    for other in block.all("Photogroups", "Photogroup", "SRSId"):
        if number is None or other.text != number.text:
            raise other.error("a photogroup in another system than the block", "export all in one system")
    return LOCAL if number is None else _system(root, number)


def _system(root: XmlElement, number: XmlElement) -> Frame:
    """The system of an SRSId."""
    systems = {srs.one("Id").text: srs.one("Definition") for srs in root.all("SpatialReferenceSystems", "SRS")}
    if number.text not in systems:
        raise number.error(f"SRSId {clipped(number.text)} is not among the systems", "export it again")
    definition = systems[number.text].text
    if re.match("LOCAL_CS", definition):
        return LOCAL
    if re.match("ENU:", definition):
        return PLANE
    return Frame("blocksexchange", _axes(definition, systems[number.text]), definition)


def _axes(definition: str, at: XmlElement) -> tuple[str, ...]:
    from aatri.frames.crs_text import crs_from

    try:
        system = crs_from(definition)
    except Exception as error:
        raise at.error(f"the system {clipped(definition)!r} is not understood: {error}", "EPSG or WKT") from error
    if system.is_geocentric:
        return XYZ
    return ("longitude", "latitude", "height") if system.is_geographic else ("east", "north", "up")


def _names(photos: list[XmlElement]) -> list[str]:
    paths = [photo.one("ImagePath").text for photo in photos]
    short = [re.split(r"[/\\]", path)[-1] for path in paths]
    names = [name if short.count(name) == 1 else path for name, path in zip(short, paths)]
    first: dict[str, XmlElement] = {}
    for key, photo in zip([*names, *(f"Id {p.one('Id').text}" for p in photos)], [*photos, *photos]):
        once(photo, key, first, "photo")
    return names


def _give_points(
    parts: BlockParts, block: XmlElement, photos: Mapping[str, _Photo], root: XmlElement, reporter: Reporter
) -> None:
    """Control, check and tie points, and where they were measured."""
    own, foreign = block.optional("SRSId"), dict[str, list[int]]()
    points, rows = list[dict[str, Any]](), list[tuple[str, str, list[float], XmlElement]]()
    for kind, name_of in (("ControlPoint", "control"), ("TiePoint", "tie")):
        for number, element, system in points_of(block, kind):
            stated = element.optional("Name")
            name = stated.text if stated is not None and stated.text else f"{name_of} {number}"
            if kind == "ControlPoint" or element.optional("Position") is not None:
                if system is not None and system.text != (own.text if own is not None else ""):
                    if own is None:
                        raise system.error("a point in a system, and the block has none", "export all in one system")
                    foreign.setdefault(system.text, []).append(len(points))
                values = _control(element) if kind == "ControlPoint" else _tie(element)
                points.append({"point": name, **values, "at": element, "system": system})
            _measured(element, name, photos, rows)
    first: dict[str, XmlElement] = {}
    for point in points:
        once(point["at"], point["point"], first, "point")
    if points:
        columns = {key: [point[key] for point in points] for key in ("point", "xyz_m", "sigma_m", "role")}
        parts.ground_points = {**columns, **places([point["at"] for point in points], parts.files)}
        for rows_of_system in foreign.values():
            _convert(parts, rows_of_system, _system(root, points[rows_of_system[0]]["system"]), reporter)
    if rows:
        parts.image_points = {
            **{key: [row[k] for row in rows] for k, key in enumerate(("image", "point", "xy"))},
            **places([row[3] for row in rows], parts.files),
        }


def _convert(parts: BlockParts, rows: list[int], frame: Frame, reporter: Reporter) -> None:
    """Bring rows of the ground points from another system into that of the block."""
    assert parts.frame is not None
    columns = dict(parts.ground_points)
    if "sigma_m" in columns:
        variance = np.asarray(columns.pop("sigma_m"), dtype=np.float64) ** 2
        columns["covariance_m2"] = np.where(np.eye(3, dtype=bool), variance[:, :, None], 0.0)
    moved = {key: np.array(columns[key], dtype=np.float64) for key in ("xyz_m", "covariance_m2")}
    control = {**{key: values[rows] for key, values in moved.items()}, "role": CONTROL}
    in_block = in_frame(
        BlockParts(parts.format, parts.files, frame=frame, ground_points=control), parts.frame, reporter
    )
    for key, values in moved.items():
        values[rows] = in_block.ground_points[key]
    parts.ground_points = {**columns, **moved}


def _control(element: XmlElement) -> dict[str, Any]:
    category = element.optional("Category")
    kind = "Full" if category is None else category.text
    if category is not None and kind not in CATEGORIES:
        raise category.error(f"category {clipped(kind)!r}", f"known are {', '.join(CATEGORIES)}")
    check = element.optional("CheckPoint")
    role = CHECK if check is not None and check.text == "true" else CONTROL
    across, up = (element.number(f"{way}Accuracy", default=np.nan) for way in ("Horizontal", "Vertical"))
    check_positive(element, (across, up))
    axes_of_category = CATEGORIES[kind]
    position = element.one("Position")
    there = [bool(k or position.all(axis)) for k, axis in zip(axes_of_category, XYZ)]
    return {
        "xyz_m": [position.number(axis) if is_there else np.nan for axis, is_there in zip(XYZ, there)],
        "sigma_m": [sigma if k else 0.0 for sigma, k in zip((across, across, up), axes_of_category)],
        "role": [role if k else APPROXIMATE if is_there else NO_ROLE for k, is_there in zip(axes_of_category, there)],
    }


def _tie(element: XmlElement) -> dict[str, Any]:
    return {"xyz_m": xyz(element.one("Position")), "sigma_m": [0.0] * 3, "role": [APPROXIMATE] * 3}


def _measured(
    element: XmlElement,
    point: str,
    photos: Mapping[str, _Photo],
    rows: list[tuple[str, str, list[float], XmlElement]],
) -> None:
    for mark in element.all("Measurement"):
        number = mark.one("PhotoId").text
        if number not in photos:
            raise mark.error(f"PhotoId {clipped(number)} is no photo of the block", "export it again")
        photo = photos[number]
        rows.append((photo.name, point, pixels_of(mark, photo.group).tolist(), mark))


BLOCKSEXCHANGE = Format(
    "blocksexchange", "BlocksExchange XML", lambda view: "<BlocksExchange" in view.head, "XML with `BlocksExchange`",
    carries=("cameras", "distortion", "image points", "control", "check points", "start values of points",
             "start orientations", "frame", "standard deviations"),
    page="docs/formats.md#blocksexchange", read=read_blocksexchange, write=write_blocksexchange,
    written=("cameras", "distortion", "image points", "control", "check points", "start values of points",
             "start orientations", "frame", "standard deviations"),
    estimates_cameras=True,
)  # fmt: skip
