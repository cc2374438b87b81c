"""images.csv, image_points.csv and fiducials.csv as tables, in canonical order."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from aatri.arrays import Float
from aatri.artifacts.block import Cameras, Fiducials
from aatri.formats.tables.cameras import check_rigs_of_images
from aatri.formats.tables.columns import FIDUCIALS, IMAGE_POINTS, IMAGES
from aatri.formats.tables.source import Source, look_up, no_repeats, not_negative
from aatri.formats.text.csv_table import MOST_PER_COLUMN, CsvTable
from aatri.ids import canonical, clipped, did_you_mean, several, shown
from aatri.regular_file import content_of


def image_columns(source: Source, cameras: Cameras) -> dict[str, Any]:
    """images.csv; nothing if it is not there."""
    table = source.table("images.csv")
    if table is None:
        return {}
    if not len(table):
        source.problems.add("no rows", str(table.path), "list the images")
    no_repeats(table, ["image"], "image")
    _near_duplicates(source, table)
    check_rigs_of_images(source, table)
    row_of = {str(name): k for k, name in enumerate(cameras.id)}
    look_up(table, "camera", row_of, "camera", "add it to `cameras` in block.yaml, or mend the id")
    unused = [name for name in row_of if name not in set(table.text["camera"])]
    if unused:
        source.reporter.warn(f"{table.path}: no image of camera {', '.join(unused)}")
    _in_order_of_time(source, table)
    _places_in_strips(source, table)
    return _with_files(source, source.columns(table, IMAGES))


def _with_files(source: Source, columns: dict[str, Any]) -> dict[str, Any]:
    """Paths of photographs and masks from the block folder, and the digest of what is there."""
    for name in ("path", "mask"):
        columns[name] = [str(source.folder / path) if path else "" for path in columns[name]]
    columns["content"] = [content_of(path, mask) for path, mask in zip(columns["path"], columns["mask"])]
    return columns


def _in_order_of_time(source: Source, table: CsvTable) -> None:
    """In a strip whose images all have a time and none a sequence, the time is the sequence."""
    strip, sequence, time = np.array(table.text["strip"]), table.number["sequence"], table.number["time"]
    flown = [
        name
        for name in canonical(name for name in table.text["strip"] if name)
        if np.isnan(sequence[strip == name]).all() and np.isfinite(time[strip == name]).all()
    ]
    if flown:
        rows = np.isin(strip, flown)
        sequence[rows] = time[rows]
        source.reporter.log(
            f"{table.path}: images of strips without sequence stand in the order of their times: strips {shown(flown)}"
        )


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
            source.reporter.warn(
                f"{table.path}: {several(len(images), 'image')} of strips {what}; their order in the strip is "
                f"that of their ids: {shown(images)}"
            )


def image_point_columns(
    source: Source, table: CsvTable, camera_of: Mapping[str, int], cameras: Cameras
) -> dict[str, Any]:
    """image_points.csv; `camera_of` gives the row of the camera of each image."""
    look_up(table, "image", camera_of, "image", "add it to images.csv, or mend the id")
    return source.columns(table, IMAGE_POINTS) | {"sigma_mm": _sigma_mm(source, table, camera_of, cameras, "image")}


def fiducial_point_columns(
    source: Source, camera_of: Mapping[str, int], cameras: Cameras, fiducials: Fiducials
) -> dict[str, Any]:
    """fiducials.csv: measured marks; nothing if it is not there, or no camera is."""
    table = source.table("fiducials.csv")
    if table is None:
        return {}
    no_repeats(table, ["image", "fiducial"], "fiducial")
    if not len(cameras):
        return {}  # every image names a camera that is not there, which is told already
    look_up(table, "image", camera_of, "image", "add it to images.csv, or mend the id")
    marks: dict[int, dict[str, int]] = {}
    for k, (camera, mark) in enumerate(zip(fiducials.camera.tolist(), fiducials.id.tolist())):
        marks.setdefault(camera, {})[mark] = k
    of_image = [marks.get(camera_of.get(image, -1), {}) for image in table.text["image"]]
    rows = [row_of.get(mark, -1) for row_of, mark in zip(of_image, table.text["fiducial"])]
    unknown = [k for k, row in enumerate(rows) if row < 0 and table.text["image"][k] in camera_of]
    for k in unknown[:MOST_PER_COLUMN]:
        mark = table.text["fiducial"][k]
        what = f"camera {cameras.id[camera_of[table.text['image'][k]]]} has no fiducial {clipped(mark)!r}"
        what += did_you_mean(mark, of_image[k])
        table.problems.add(what, table.where(k, "fiducial"), "add it to the camera")
    sigma_mm = _sigma_mm(source, table, camera_of, cameras, "fiducial")
    return source.columns(table, FIDUCIALS) | {"fiducial": rows, "sigma_mm": sigma_mm}


def _sigma_mm(source: Source, table: CsvTable, camera_of: Mapping[str, int], cameras: Cameras, kind: str) -> Float:
    """Standard deviations in mm, the default where a cell is empty; fiducials fall back on that of image points."""
    units, defaults = source.settings.units, source.settings.sigma
    default = defaults.image if kind == "image" else defaults.fiducial or defaults.image
    sigma = np.stack([table.number["sx"], table.number["sy"]], axis=1)
    for name in ("sx", "sy"):
        not_negative(table, name, zero=False)
    empty = np.isnan(sigma)
    if empty.any() and default is None:
        row, column = np.argwhere(empty)[0]
        what = (
            f"no standard deviation in {several(int(empty.any(axis=1).sum()), 'row')}, and no "
            f"sigma.{kind} in block.yaml"
        )
        unit = units.sigma_image
        source.problems.add(
            what, table.where(int(row), ("sx", "sy")[column]), f"add sigma: {{{kind}: 5}} ({unit}) to block.yaml"
        )
        return sigma
    sigma = np.where(empty, default if default is not None else np.nan, sigma)
    if units.sigma_image != "px":
        return sigma * units.sigma_image_mm(1.0)
    if not len(cameras):
        return sigma
    camera = np.array([camera_of.get(image, 0) for image in table.text["image"]], np.intp)
    size = cameras.pixel_size_mm[camera]
    lacking = np.unique(camera[np.isnan(size).any(axis=1)])
    for k in lacking.tolist():
        where = source.document.where("cameras", str(cameras.id[k]))
        what = f"units.sigma_image is px, but camera {cameras.id[k]} has no pixel size"
        source.problems.add(what, where, "add pixel: {size: ...}, or use um")
    return sigma * size


def _near_duplicates(source: Source, table: CsvTable) -> None:
    """Warn of image ids that differ in upper and lower case only."""
    first: dict[str, str] = {}
    for name in table.text["image"]:
        other = first.setdefault(name.casefold(), name)
        if other != name:
            source.reporter.warn(f"{table.path}: images {clipped(other)!r} and {clipped(name)!r} differ in case only")
