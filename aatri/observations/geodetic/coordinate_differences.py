"""Coordinate differences between two stations: GNSS baselines and the like, in the axes of the block's first frame.

    v = (X(B) + h_B u(B)) - (X(A) + h_A u(A)) - d,    one coordinate of it a row

u is the vertical, h are the heights of the antennas above their points. The three rows of a baseline are correlated by
covariances.csv, see `correlated`. Source: docs/formulas.md 5.4.
"""

from __future__ import annotations

import numpy as np

from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import State
from aatri.arrays import Float, Int
from aatri.observations.geodetic.sights import Sights, alike, groups_of, sights_of
from aatri.observations.level import Level
from aatri.observations.observed import NEARLY_EXACT, Given, Observed, named
from aatri.observations.poses import by_unknowns, position

KIND = "coordinate_difference"

AXES = ("dX", "dY", "dZ")

USES = (*(f"geodetic:{axis}{end}" for axis in AXES for end in ("", "_to_image")), "geodetic.heights")


def coordinate_differences(given: Given) -> tuple[Observed, ...]:
    """Coordinate differences of the geodetic observations."""
    found = []
    for number, axis in enumerate(AXES):
        for part, exact in alike(sights_of(given.block, axis)):
            records = _records(part, given.level, number)
            names = np.char.add(part.names, f" {axis}")
            sees = (number == 0, number == 1, number == 2)
            found.append(Observed(records, part.row, named(point=names), "m", exact=exact, sees=sees))
    return tuple(found)


def _records(rows: Sights, level: Level, axis: int) -> Records:
    at, to = groups_of(rows)

    def evaluate(state: State, some: Int) -> tuple[Float, tuple[Float, ...]]:
        low, by_start = _above(level, position(state, at)[rows.station[some]], rows.station_height_m[some])
        high, by_end = _above(level, position(state, to)[rows.target[some]], rows.target_height_m[some])
        v = (high - low)[:, axis] - rows.value[some]
        return v[:, None], (by_unknowns(at, -by_start[:, axis, None]), by_unknowns(to, by_end[:, axis, None]))

    sigma = np.where(rows.sigma > 0, rows.sigma, NEARLY_EXACT)
    active = np.ones(len(rows), dtype=bool)
    return Records(KIND, ((at, rows.station), (to, rows.target)), evaluate, 1.0 / sigma[:, None], active)


def _above(level: Level, xyz: Float, height: Float) -> tuple[Float, Float]:
    """Coordinates of the block's first frame at a height above some places, and their derivatives."""
    up, d_up = (a[:, 2] for a in level.axes(xyz))
    found, J = level.coordinates(xyz + height[:, None] * up)
    return found, J @ (np.eye(3) + height[:, None, None] * d_up)
