"""Height differences, levelled or trigonometric, in the vertical datum of the block.

    v = (H(B) + h_B) - (H(A) + h_A) - dh

H is the height at a place: Z in a local or map frame, the height above the surface of the vertical datum in a tangent
frame. Source: docs/formulas.md 5.4.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import State
from aatri.arrays import Float, Int
from aatri.observations.geodetic.sights import HEIGHT, Sights, alike, groups_of, sights_of
from aatri.observations.level import Level
from aatri.observations.observed import NEARLY_EXACT, Given, Observed, named
from aatri.observations.poses import by_unknowns, position

KIND = "height_difference"

USES = ("geodetic:height_difference", "geodetic:height_difference_to_image", "geodetic.heights")


def height_differences(given: Given) -> tuple[Observed, ...]:
    """Height differences of the geodetic observations."""
    return tuple(observed_heights(sights_of(given.block, KIND), given.level))


def observed_heights(rows: Sights, level: Level) -> Iterator[Observed]:
    """Height differences as observations."""
    for part, exact in alike(rows):
        records = _records(part, level)
        yield Observed(records, part.row, named(point=part.names), "m", exact=exact, sees=HEIGHT)


def _records(rows: Sights, level: Level) -> Records:
    at, to = groups_of(rows)

    def evaluate(state: State, some: Int) -> tuple[Float, tuple[Float, ...]]:
        low, by_start = level.height(position(state, at)[rows.station[some]])
        high, by_end = level.height(position(state, to)[rows.target[some]])
        v = high + rows.target_height_m[some] - low - rows.station_height_m[some] - rows.value[some]
        return v[:, None], (by_unknowns(at, -by_start[:, None, :]), by_unknowns(to, by_end[:, None, :]))

    sigma = np.where(rows.sigma > 0, rows.sigma, NEARLY_EXACT)
    active = np.ones(len(rows), dtype=bool)
    return Records(KIND, ((at, rows.station), (to, rows.target)), evaluate, 1.0 / sigma[:, None], active)
