"""images.csv, image_points.csv and fiducials.csv as tables, in canonical order."""

from __future__ import annotations

from itertools import repeat
from typing import NamedTuple

import numpy as np

from aatri.arrays import Float, Int
from aatri.artifacts.block import Cameras, FiducialPoints, Fiducials, ImagePoints, Images, Points, Strips
from aatri.errors import InputError
from aatri.formats.tables.rigs import check_rigs_of_images
from aatri.formats.tables.source import Source, look_up, no_repeats, not_negative, texts, yes_no
from aatri.formats.text.csv_table import MOST_PER_COLUMN, Column, CsvTable
from aatri.ids import canonical, clipped, did_you_mean, shown

ID, TEXT, NUMBER, NEEDED = Column("id", "cell"), Column("text"), Column("number"), Column("number", "cell")

IMAGES = {
    "image": ID, "camera": ID, "strip": Column("id"), "sequence": NUMBER, "time": NUMBER, "flight": TEXT,
    "session": TEXT, "rig": TEXT, "member": TEXT,
}  # fmt: skip
IMAGE_POINTS = {
    "image": ID, "point": ID, "x": NEEDED, "y": NEEDED, "sx": NUMBER, "sy": NUMBER, "group": TEXT, "active": TEXT,
    "row_time": NUMBER,
}  # fmt: skip
FIDUCIALS = {"image": ID, "fiducial": ID, "x": NEEDED, "y": NEEDED, "sx": NUMBER, "sy": NUMBER}


class ImageTables(NamedTuple):
    """Images, their strips, and the row of each id."""

    images: Images
    strips: Strips
    row: dict[str, int]


def image_tables(source: Source, cameras: Cameras) -> ImageTables:
    """images.csv: images sorted by id, and the strips they name."""
    table = source.table("images.csv", IMAGES)
    if table is None:
        return ImageTables(Images.empty(), Strips.empty(), {})
    if not len(table):
        source.problems.append(InputError("no rows", where=str(table.path), remedy="list the images"))
    no_repeats(table, ["image"], "image")
    _near_duplicates(source, table)
    check_rigs_of_images(source, table)
    known = {str(name): k for k, name in enumerate(cameras.id)}
    camera = look_up(table, "camera", known, "camera", "add it to `cameras` in block.yaml, or mend the id")
    unused = [name for name in known if name not in set(table.text["camera"])]
    if unused:
        source.reporter.warn(f"{table.path}: no image of camera {', '.join(unused)}")
    _in_order_of_time(source, table)
    _places_in_strips(source, table)
    strip_ids = canonical(name for name in table.text["strip"] if name)
    strip_row = {name: k for k, name in enumerate(strip_ids)}
    ids = table.text["image"]
    order = sorted(range(len(ids)), key=lambda k: ids[k].encode())
    images = Images(
        id=texts(ids), camera=np.maximum(camera, 0),
        strip=np.array([strip_row.get(name, -1) for name in table.text["strip"]], np.int32),
        sequence=table.number["sequence"], time_s=table.number["time"] * source.settings.units.time_s,
        flight=texts(table.text["flight"]), session=texts(table.text["session"]), rig=texts(table.text["rig"]),
        member=texts(table.text["member"]), active=np.ones(len(table), bool),
        file=source.file("images.csv", len(table)), line=table.line,
    ).take(np.array(order, dtype=np.intp))  # fmt: skip
    return ImageTables(images, Strips(id=texts(strip_ids)), {str(name): k for k, name in enumerate(images.id)})


def _in_order_of_time(source: Source, table: CsvTable) -> None:
    """In a strip whose images all have a time and none a sequence, the time is the sequence."""
    strip, sequence, time = np.array(table.text["strip"]), table.number["sequence"], table.number["time"]
    flown = [
        name for name in canonical(name for name in table.text["strip"] if name)
        if np.isnan(sequence[strip == name]).all() and np.isfinite(time[strip == name]).all()
    ]  # fmt: skip
    if flown:
        rows = np.isin(strip, flown)
        sequence[rows] = time[rows]
        source.reporter.log(f"{table.path}: images of strips without sequence stand in the order of their times: "
                            f"strips {shown(flown)}")  # fmt: skip


def _places_in_strips(source: Source, table: CsvTable) -> None:
    """Warn of images of one strip and camera without a place in it, or with the same one."""
    lacking, seen, twice = list[str](), dict[tuple[str, ...], str](), list[str]()
    cells = zip(*(table.text[name] for name in ("image", "strip", "camera", "member")), table.number["sequence"])
    for image, strip, camera, member, sequence in cells:
        if strip and np.isnan(sequence):
            lacking.append(image)
        elif strip and seen.setdefault((strip, camera, member, repr(float(sequence))), image) != image:
            twice.append(image)
    for images, what in ((lacking, "have no sequence"), (twice, "have the sequence of another image of their strip")):
        if images:
            source.reporter.warn(f"{table.path}: {len(images)} images of strips {what}; their order in the strip is "
                                 f"that of their ids: {shown(images)}")  # fmt: skip


def read_image_points(source: Source) -> CsvTable | None:
    """image_points.csv as it stands."""
    return source.table("image_points.csv", IMAGE_POINTS)


def image_point_table(source: Source, table: CsvTable | None, images: ImageTables, cameras: Cameras,
                      points: Points) -> ImagePoints:  # fmt: skip
    """Image points sorted by image, point, x, y; standard deviations in mm."""
    if table is None:
        return ImagePoints.empty()
    image = look_up(table, "image", images.row, "image", "add it to images.csv, or mend the id")
    point_row = {str(name): k for k, name in enumerate(points.id)}
    point = np.fromiter(map(point_row.get, table.text["point"], repeat(0)), np.int32, len(table))
    sigma = _sigma_mm(source, table, image, images, cameras, "image")
    rows = ImagePoints(
        image=np.maximum(image, 0), point=point, xy=np.stack([table.number["x"], table.number["y"]], axis=1),
        sigma_mm=sigma, group=texts(table.text["group"]), active=yes_no(table, "active", True),
        row_time_s=table.number["row_time"] * source.settings.units.time_s,
        file=source.file("image_points.csv", len(table)), line=table.line,
    ) if not source.problems else ImagePoints.empty()  # fmt: skip
    return rows.take(image_point_order(rows))


def image_point_order(rows: ImagePoints) -> Int:
    """The canonical order: by image, point, x, y, then whatever may still differ."""
    order = np.lexsort((rows.xy[:, 1], rows.xy[:, 0], rows.point, rows.image))
    same = (np.diff(rows.image[order]) == 0) & (np.diff(rows.point[order]) == 0)
    if not same.any():
        return order
    return np.lexsort((rows.row_time_s, rows.active, rows.group, rows.sigma_mm[:, 1], rows.sigma_mm[:, 0],
                       rows.xy[:, 1], rows.xy[:, 0], rows.point, rows.image))  # fmt: skip


def fiducial_point_table(source: Source, images: ImageTables, cameras: Cameras, fiducials: Fiducials) -> FiducialPoints:
    """fiducials.csv: measured marks sorted by image and mark."""
    table = source.table("fiducials.csv", FIDUCIALS)
    if table is None:
        return FiducialPoints.empty()
    no_repeats(table, ["image", "fiducial"], "fiducial")
    if not len(cameras):
        return FiducialPoints.empty()  # every image names a camera that is not there, which is told already
    image = look_up(table, "image", images.row, "image", "add it to images.csv, or mend the id")
    marks: dict[int, dict[str, int]] = {}
    for k, (camera, mark) in enumerate(zip(fiducials.camera.tolist(), fiducials.id.tolist())):
        marks.setdefault(camera, {})[mark] = k
    camera_of = images.images.camera
    rows = np.zeros(len(table), np.int32)
    unknown = []
    for k, mark in enumerate(table.text["fiducial"]):
        if image[k] >= 0:
            rows[k] = marks.get(int(camera_of[image[k]]), {}).get(mark, -1)
            if rows[k] < 0:
                unknown.append(k)
    for k in unknown[:MOST_PER_COLUMN]:
        camera = int(camera_of[image[k]])
        mark = table.text["fiducial"][k]
        what = f"camera {cameras.id[camera]} has no fiducial {clipped(mark)!r}"
        what += did_you_mean(mark, marks.get(camera, {}))
        table.problems.append(InputError(what, where=table.where(k, "fiducial"), remedy="add it to the camera"))
    sigma = _sigma_mm(source, table, image, images, cameras, "fiducial")
    if source.problems:
        return FiducialPoints.empty()
    measured = FiducialPoints(
        image=image, fiducial=rows, xy=np.stack([table.number["x"], table.number["y"]], axis=1), sigma_mm=sigma,
        file=source.file("fiducials.csv", len(table)), line=table.line,
    )  # fmt: skip
    return measured.take(np.lexsort((measured.fiducial, measured.image)))


def _sigma_mm(source: Source, table: CsvTable, image: Int, images: ImageTables, cameras: Cameras,
              kind: str) -> Float:  # fmt: skip
    """Standard deviations in mm, the default where a cell is empty; fiducials fall back on that of image points."""
    units, defaults = source.settings.units, source.settings.sigma
    default = defaults.image if kind == "image" else defaults.fiducial or defaults.image
    given = np.stack([table.number["sx"], table.number["sy"]], axis=1)
    for name in ("sx", "sy"):
        not_negative(table, name, zero=False)
    empty = np.isnan(given)
    if empty.any() and default is None:
        row, column = np.argwhere(empty)[0]
        what = f"no standard deviation in {int(empty.any(axis=1).sum())} rows, and no sigma.{kind} in block.yaml"
        unit = units.sigma_image
        source.problems.append(InputError(what, where=table.where(int(row), ("sx", "sy")[column]),
                                          remedy=f"add sigma: {{{kind}: 5}} ({unit}) to block.yaml"))  # fmt: skip
        return given
    given = np.where(empty, default if default is not None else np.nan, given)
    if units.sigma_image != "px":
        return given * units.sigma_image_mm(1.0)
    camera = np.maximum(images.images.camera[np.maximum(image, 0)], 0) if len(images.images) else np.zeros_like(image)
    size = cameras.pixel_size_mm[camera]
    lacking = np.unique(camera[np.isnan(size).any(axis=1)])
    for k in lacking.tolist():
        where = source.document.where("cameras", str(cameras.id[k]))
        what = f"units.sigma_image is px, but camera {cameras.id[k]} has no pixel size"
        source.problems.append(InputError(what, where=where, remedy="add pixel: {size: ...}, or use um"))
    return given * size


def _near_duplicates(source: Source, table: CsvTable) -> None:
    """Warn of image ids that differ in upper and lower case only."""
    first: dict[str, str] = {}
    for name in table.text["image"]:
        other = first.setdefault(name.casefold(), name)
        if other != name:
            source.reporter.warn(f"{table.path}: images {clipped(other)!r} and {clipped(name)!r} differ in case only")
