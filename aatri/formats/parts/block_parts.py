"""What one file or folder gives of a block: columns of its tables by ids, in its own order, frame and units told.

A reader of a format gives `BlockParts`, be it a whole project or a list of control points; `assembled` makes a Block
of the parts of one or several sources. The columns are those of `block_of` (`aatri.artifacts.builder`): metres,
millimetres on the image, radians. Beside them there are

    image_points   sigma_px      instead of sigma_mm: in pixels of the image's camera
    exterior       ground_from_image (n, 3, 3) instead of angles_rad: photogrammetric axes (x right, y up, looking
                   along -z) to the axes of `frame`; NaN where only the position is given

A standard deviation that the file does not state is left out or NaN; `assembled` gives it the one of the options.
`line` is the line in `files[0]`, unless `file` says another. Positions and attitudes are start values unless
`position_use` and `angle_use` say that they were observed.

Here too: columns with a value for every row, and those of several sources one below the other, where references to
other tables are ids, not rows, and `file` counts in the files of all sources together; and what no source may say,
whatever its format: an id twice in a list, a latitude beyond the pole.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.artifacts.block import CameraParameters, Cameras, Exterior, GroundPoints, Images, MeasuredPoints
from aatri.errors import InputError
from aatri.formats.conventions.pixel_origins import PixelAxes
from aatri.frames.checks import out_of_range
from aatri.frames.conversion import Frame
from aatri.ids import MAX_BYTES, OF_IDS, clipped
from aatri.tables.checked_column import DTYPES, Column
from aatri.tables.schema import Table, columns_of
from aatri.units import SMALLEST

LOCAL = Frame("local", ("x", "y", "z"), "local")
"""Cartesian, anywhere, of unknown scale: a free model."""

PLANE = Frame("local", ("east", "north", "up"), "local")
"""Coordinates of control or positions in metres, of no named system."""

Columns = Mapping[str, Any]
"""Columns of a table by name."""

Rows = dict[str, npt.NDArray[Any]]
"""Columns of equal length by name."""

KINDS: dict[str, type[Table]] = {
    "cameras": Cameras,
    "camera_parameters": CameraParameters,
    "images": Images,
    "image_points": MeasuredPoints,
    "ground_points": GroundPoints,
    "exterior": Exterior,
}
"""Tables that sources may give."""

EXTRA = {
    "image_points": {
        "sigma_px": Column("f8", (2,), "px", "", "", True, False, np.nan),
        "pixel_axes": Column("str", (), "", "origin, y and unit; empty: those of the camera", "", False, False, ""),
    },
    "exterior": {"ground_from_image": Column("f8", (3, 3), "", "", "", True, False, np.nan)},
}
"""Columns beside those of the Block."""

NOT_STATED = {
    ("ground_points", "covariance_m2"): np.nan,
    ("image_points", "sigma_mm"): np.nan,
    ("images", "camera"): "",
    ("cameras", "principal_distance_mm"): np.nan,
    ("ground_points", "xyz_m"): np.nan,
}
"""What rows have that a source does not state, where the default of the Block would say something."""

IDS = (
    ("cameras", "id", "camera"),
    ("images", "id", "image"),
    ("exterior", "image", "orientation of image"),
    ("ground_points", "point", "ground point"),
)
SIGMAS = (("exterior", "sigma_m"), ("ground_points", "sigma_m"), ("image_points", "sigma_px"))
PLACES = (("exterior", "image", "position_m"), ("ground_points", "point", "xyz_m"))


FILES = ("path", "mask")
"""Columns with paths, which may be longer than names."""


@dataclass
class BlockParts:
    """What one file or folder gives of a block; a table without columns is one that the format does not have here."""

    format: str
    """Name of the format."""
    files: list[Path]
    """Read files; the columns `file` count in it."""
    name: str = ""
    frame: Frame | None = None
    """Of ground points, positions and rotations, axes in the order of the columns; None: the files do not say, so that
    they are taken to be in the frame of the block. `LOCAL`: a free model."""
    cameras: Columns = field(default_factory=dict)
    camera_parameters: Columns = field(default_factory=dict)
    """`camera`, `name`, `value`: of the distortion; all are held, unless `sigma` or `free` says more."""
    images: Columns = field(default_factory=dict)
    image_points: Columns = field(default_factory=dict)
    ground_points: Columns = field(default_factory=dict)
    exterior: Columns = field(default_factory=dict)
    pixel_axes: PixelAxes | None = None
    """What the image points count from; None: as the camera of their image says."""
    others: Columns = field(default_factory=dict)
    """Tables and attributes of a Block that are taken as they are, if this is the first source."""
    notes: list[str] = field(default_factory=list)
    """What the user should know of how it was read."""
    not_stated: Mapping[str, Any] = field(default_factory=dict)
    """Options of `NotStated` that it says for all rows without a value of their own, those of other sources too."""


def rows_of(parts: BlockParts, table: str, first_file: int = 0) -> Rows:
    """A table of a source: every column, with a value for every row.

    Parameters
    ----------
    table : str
        One of `KINDS`.
    first_file : int
        Place of the first file of the source among those of all.
    """
    columns = dict(getattr(parts, table))
    if not columns:
        return {}
    if "sigma_m" in columns:
        variance = np.asarray(columns.pop("sigma_m"), dtype=np.float64)[..., None] ** 2
        covariance = "position_covariance_m2" if table == "exterior" else "covariance_m2"
        # what is not stated is NaN there alone
        columns[covariance] = np.where(np.eye(3, dtype=bool), variance * np.eye(3), 0.0)
    if table == "image_points" and parts.pixel_axes is not None:
        columns["pixel_axes"] = parts.pixel_axes.name
    if "line" in columns:
        columns.setdefault("file", 0)
    declared = dict(columns_of(KINDS[table])) | EXTRA.get(table, {})
    if unknown := sorted(columns.keys() - declared.keys()):
        raise ValueError(f"reader of {parts.format}: {table} has no column {', '.join(unknown)}")
    n = max(len(np.asarray(v)) for name, v in columns.items() if _has_rows(v, declared[name]))
    made = {}
    for name, column in declared.items():
        dtype = "str" if column.refers and column.refers != "files" else column.dtype
        default = NOT_STATED.get((table, name), column.default)
        default = {"str": "", "f8": np.nan}.get(dtype, -1) if default is None or dtype != column.dtype else default
        values = columns.get(name, default)
        made[name] = _column(values, dtype, column.shape, n)
    made["file"] = (
        np.where(made["file"] >= 0, made["file"] + first_file, -1) if "file" in made else np.full(n, first_file)
    )
    return made


def together(tables: Sequence[Rows]) -> Rows:
    """Tables one below the other."""
    filled = [t for t in tables if t]
    if not filled:
        return {}
    return {name: np.concatenate([t[name] for t in filled]) for name in filled[0]}


def taken(rows: Rows, which: npt.ArrayLike) -> Rows:
    """Some rows, by number or mask."""
    chosen = np.asarray(which)
    return {name: values[chosen] for name, values in rows.items()}


def place(rows: Mapping[str, Any], row: int, files: Sequence[Any]) -> str:
    """`file:line` of a row; empty where it is not known."""
    file, line = int(rows["file"][row]) if "file" in rows else -1, int(rows["line"][row]) if "line" in rows else -1
    if not 0 <= file < len(files):
        return ""
    return f"{files[file]}:{line}" if line > 0 else str(files[file])


def twice(rows: Rows, key: str, what: str, files: Sequence[Any]) -> None:
    """Refuse a table in which an id stands twice.

    Raises
    ------
    InputError
        With the place of the second row.
    """
    if not rows:
        return
    _, first, count = np.unique(rows[key], return_index=True, return_counts=True)
    for k in first[count > 1].tolist():
        name = str(rows[key][k])
        again = int(np.flatnonzero(rows[key] == name)[1])
        raise InputError(
            f"{what} {name!r} stands twice, first in {place(rows, k, files) or 'row ' + str(k + 1)}",
            where=place(rows, again, files),
            remedy="remove one, or give it another name",
        )


def _has_rows(values: Any, declared: Column) -> bool:
    array = np.asarray(values)
    return array.ndim > len(declared.shape)


def _column(values: Any, dtype: str, shape: tuple[int, ...], n: int) -> npt.NDArray[Any]:
    array = np.asarray(values)
    array = array.astype(np.str_) if dtype == "str" else array.astype(DTYPES[dtype])
    return array if array.ndim > len(shape) else np.broadcast_to(array, (n, *shape)).copy()


def check_parts(parts: BlockParts) -> None:
    """Check what one source gives.

    Raises
    ------
    InputError
        With the place of the first row that cannot be.
    """
    _check_lengths(parts)
    tables: dict[str, Any] = {table: rows_of(parts, table) for table, _, _ in IDS}
    for table, key, what in IDS:
        twice(tables[table], key, what, parts.files)
    _check_sigmas(parts)
    if parts.frame is None:
        return
    for table, key, column in PLACES:
        if not (rows := tables[table]):
            continue
        wrong = np.flatnonzero(out_of_range(rows[column], parts.frame.axes))
        if len(wrong):
            k = int(wrong[0])
            x, y = (f"{name} {rows[column][k, parts.frame.axes.index(name)]:g}" for name in ("latitude", "longitude"))
            what = f"{rows[key][k]} lies at {x}, {y}: {parts.frame.crs} counts degrees, up to 90 and 360"
            raise InputError(what, where=place(rows, k, parts.files), remedy="say the `crs` of the coordinates")


def _check_lengths(parts: BlockParts) -> None:
    """Refuse names beyond all length at once: as arrays all names of a table are as long as the longest."""
    for table in KINDS:
        columns = getattr(parts, table)
        for name, values in columns.items():
            if name in FILES:
                continue
            if isinstance(values, np.ndarray) and values.dtype.kind not in "UO":
                continue
            texts = values if isinstance(values, list | tuple) else np.atleast_1d(values).tolist()
            if texts and isinstance(texts[0], str) and len(longest := max(texts, key=len)) > MAX_BYTES:
                at = {
                    k: np.broadcast_to(np.ravel(columns.get(k, 0))[: len(texts)], len(texts)) for k in ("file", "line")
                }
                where = place(at, texts.index(longest), parts.files)
                raise InputError(f"{clipped(longest)!r} is no id or name", where=where, remedy=OF_IDS)


def _check_sigmas(parts: BlockParts) -> None:
    for table, column in SIGMAS:
        columns = getattr(parts, table)
        sigma = np.asarray(columns.get(column, np.nan), dtype=np.float64)
        if len(wrong := np.argwhere((sigma > 0) & (sigma < SMALLEST))):
            value, row = sigma[tuple(wrong[0])], int(wrong[0][0]) if sigma.ndim else 0
            where = place(rows_of(parts, table), row, parts.files)
            raise InputError(f"{value:g} is too small for a standard deviation", where=where, remedy="0 is exact")
