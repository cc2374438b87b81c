"""Heights above a geoid that is given as a grid file, made ellipsoidal: h = H + N.

N is interpolated by PROJ (`vgridshift`) in the very file that is named: nothing is looked up, fetched or guessed.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from aatri.arrays import Float
from aatri.errors import InputError
from aatri.formats.parts.block_parts import BlockParts
from aatri.ids import several, shown
from aatri.regular_file import open_regular

ENDINGS = (".tif", ".gtx")
"""Grids of undulations that PROJ reads: GTG and GTX."""


_OF_UNDULATIONS = (b"VERTICAL_OFFSET_GEOGRAPHIC_TO_VERTICAL", b"geoid_undulation")
"""Words of the metadata of a grid of PROJ (GTG)."""
_BEGINNING = 1 << 16


def is_geoid_grid(path: Path) -> bool:
    """Whether a file is a grid of undulations: a GTG by its metadata, a GTX by its ending."""
    if path.suffix.lower() not in ENDINGS or not path.is_file():
        return False
    if path.suffix.lower() == ".gtx":
        return True
    with open_regular(path) as file:
        data = file.read(_BEGINNING)
    return any(words in data for words in _OF_UNDULATIONS)


def with_ellipsoidal_heights(parts: BlockParts, grid: Path) -> BlockParts:
    """The parts with the heights of ground points and positions raised by the undulation of a grid.

    Raises
    ------
    InputError
        If the parts are in no named coordinate system, the grid cannot be read, or a place lies outside of it.
    """
    if parts.frame is None or parts.frame.crs == "local":
        what = "heights above a geoid, but no coordinate system by which to find the places in its grid"
        raise InputError(what, where=str(parts.files[0]), remedy="give `crs` beside `geoid`")
    ground, exterior = dict(parts.ground_points), dict(parts.exterior)
    axis = parts.frame.axes.index("height" if "height" in parts.frame.axes else "up")
    for columns, key, names in ((ground, "xyz_m", "point"), (exterior, "position_m", "image")):
        if columns:
            place = np.array(columns[key], dtype=np.float64)
            place[:, axis] += _undulations_m(parts, grid, place, np.asarray(columns[names]))
            columns[key] = place
    notes = [*parts.notes, f"heights are above {grid.name}, and ellipsoidal in the block"]
    return replace(parts, ground_points=ground, exterior=exterior, notes=notes)


def _undulations_m(parts: BlockParts, grid: Path, place: Float, names: Any) -> Float:
    """N at some places (n,), 0 where there is none."""
    from pyproj import CRS, Transformer

    if grid.suffix.lower() not in ENDINGS or not grid.is_file():
        raise InputError("is no grid of a geoid", where=str(grid), remedy=f"give a file {' or '.join(ENDINGS)}")
    assert parts.frame is not None
    horizontal = CRS.from_user_input(parts.frame.crs)
    to_geographic = Transformer.from_crs(horizontal, horizontal.geodetic_crs, always_xy=True)
    first, second = (
        parts.frame.axes.index(name)
        for name in (("longitude", "latitude") if parts.frame.geographic else ("east", "north"))
    )
    placed = np.isfinite(place).all(axis=1)
    longitude, latitude = to_geographic.transform(place[placed, first], place[placed, second])
    radians = "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad"
    step = f'{radians} +step +proj=vgridshift +multiplier=1 +grids="{grid}"'
    try:
        raised = Transformer.from_pipeline(step).transform(longitude, latitude, np.zeros(int(placed.sum())))[2]
    except Exception as error:
        raise InputError(f"PROJ cannot read it: {error}", where=str(grid), remedy="give another grid") from error
    if not np.isfinite(raised).all():
        outside = np.asarray(names)[placed][~np.isfinite(raised)].tolist()
        what = f"{several(len(outside), 'place', 'lies', 'lie')} outside of the grid {grid.name}: {shown(outside, 5)}"
        raise InputError(what, where=str(parts.files[0]), remedy="give the grid of the region")
    undulation = np.zeros(len(place))
    undulation[placed] = raised
    return undulation
