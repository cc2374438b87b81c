"""Columns of a table with a value for every row, and the same of several sources one below the other.

References to other tables are ids here, not rows; `file` counts in the files of all sources together.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.artifacts.block import CameraParameters, Cameras, Exterior, GroundPoints, Images, MeasuredPoints
from aatri.errors import InputError
from aatri.formats.parts.block_parts import BlockParts
from aatri.tables.checked_column import DTYPES
from aatri.tables.schema import Column, Table, columns_of

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
