"""Distances, equal distances, and differences of one coordinate between two points.

    distance               v = |B - A| - d,        also between projection centres
    equal_distance         v = |B - A| - l,        l the common length, an unknown
    coordinate_difference  v = X_B - X_A - value,  X one coordinate of the block's first frame

Source: docs/formulas.md 5.5.
"""

import numpy as np

from aatri.adjustment.unknowns import State
from aatri.arrays import Float, Int
from aatri.observations.geodetic.differences import along, between_coordinates
from aatri.observations.geodetic.sights import ALL, observed_sights, slope
from aatri.observations.level import PLANE
from aatri.observations.observed import ObservationSource, Observed
from aatri.observations.poses import POINT
from aatri.observations.relative.members import Conditions, means, observed_conditions, pairs_as_sights
from aatri.observations.relative.shapes import NOTHING, seeing

DISTANCE, EQUAL, DIFFERENCE = "relative_distance", "equal_distance", "relative_difference"

USES = ("relative_control:distance", "relative_control:equal_distance", "relative_control:coordinate_difference")


def relative_distances(source: ObservationSource) -> tuple[Observed, ...]:
    """Distances of the relative control, between points or projection centres."""
    return tuple(observed_sights(DISTANCE, pairs_as_sights(source.block, "distance"), PLANE, slope, "m"))


def relative_differences(source: ObservationSource) -> tuple[Observed, ...]:
    """Equal distances and coordinate differences of the relative control."""
    observed = [*observed_conditions(source, EQUAL, _equal, at_once=2)]
    sights = pairs_as_sights(source.block, "coordinate_difference")
    for axis, name in enumerate("XYZ"):
        of_axis = sights.take(source.block.relative_control.axis[sights.row] == name)
        sees = ALL if source.level.curved else (axis == 0, axis == 1, axis == 2)
        observed += observed_sights(DIFFERENCE, of_axis, source.level, along(axis), "m", sees, between_coordinates)
    return tuple(observed)


def _equal(source: ObservationSource, conditions: Conditions) -> Observed:
    pairs, condition, n = conditions.point, conditions.of, len(conditions.row)

    def evaluate(state: State, rows: Int) -> tuple[Float, tuple[Float, ...]]:
        x = state[POINT]
        length, u = slope(x[pairs[rows, 1]] - x[pairs[rows, 0]])
        v = length - state[conditions.group][condition[rows], 0]
        return v[:, None], (-u[:, None, :], u[:, None, :], -np.ones((len(rows), 1, 1)))

    def generator(state: State) -> Float:
        moves = np.zeros((n, 1, 7))
        moves[:, 0, 6] = state[conditions.group][:, 0]
        return moves

    x = source.start[POINT]
    length = np.linalg.norm(x[pairs[:, 1]] - x[pairs[:, 0]], axis=1)
    placed = np.flatnonzero(np.isfinite(length))
    return conditions.observed(
        evaluate, means(length[placed, None], condition[placed], n), ("length",), generator, seeing(NOTHING)
    )
