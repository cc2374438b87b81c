"""What a source may not say, whatever its format: an id twice in a list, a latitude beyond the pole."""

from typing import Any

import numpy as np

from aatri.errors import InputError
from aatri.formats.parts.block_parts import BlockParts
from aatri.formats.parts.rows import KINDS, place, rows_of, twice
from aatri.frames.checks import out_of_range
from aatri.ids import MAX_BYTES, OF_IDS, clipped
from aatri.units import SMALLEST

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
