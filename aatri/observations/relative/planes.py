"""Points of one plane: any, vertical, horizontal.

    plane       v = n'(x - 0) - d,   n = (t1, t2, 1) / sqrt(1 + t1^2 + t2^2)
    vertical    the same with t2 = 0, the second axis being the vertical
    horizontal  v = H(X) - h,        also `equal_height`: points of a lake shore

x are coordinates in the axes of the plane at the start, its normal the last. Source: docs/formulas.md 5.5.
"""

import numpy as np

from aatri.adjustment.unknowns import State
from aatri.arrays import Float, Int, finite_rows
from aatri.observations.geodetic.sights import ALL, HEIGHT
from aatri.observations.observed import ObservationSource, Observed
from aatri.observations.poses import POINT, point_generator
from aatri.observations.relative.members import Conditions, means, observed_conditions
from aatri.observations.relative.shapes import TILT, Shape, along_horizontal, main_axes, observed_shapes, seeing

LEVEL_TYPES = ("horizontal_plane", "equal_height")

USES = tuple(f"relative_control:{t}" for t in ("plane", "vertical_plane", *LEVEL_TYPES))


def planes(source: ObservationSource) -> tuple[Observed, ...]:
    """Points of planes, and of equal height."""
    observed = [*observed_shapes(source, PLANE_SHAPE), *observed_shapes(source, VERTICAL)]
    for type_ in LEVEL_TYPES:
        observed += observed_conditions(source, type_, _level)
    return tuple(observed)


def _plane(x: Float, t: Float) -> tuple[Float, Float, Float]:
    m = np.column_stack([t[:, :2], np.ones(len(t))])
    size = np.linalg.norm(m, axis=1)
    n = m / size[:, None]
    distance = np.einsum("ni,ni->n", n, x)
    by_t = (x[:, :2] - distance[:, None] * n[:, :2]) / size[:, None]
    return (distance - t[:, 2])[:, None], n[:, None, :], np.column_stack([by_t, -np.ones(len(t))])[:, None, :]


def _vertical(x: Float, t: Float) -> tuple[Float, Float, Float]:
    v, by_x, by_t = _plane(x, np.column_stack([t[:, 0], np.zeros(len(t)), t[:, 1]]))
    return v, by_x, by_t[:, :, [0, 2]]


def _fit_plane(points: Float, _axes: Float) -> tuple[Float, Float, Float]:
    return main_axes(points), points.mean(axis=0), np.zeros(3)


def _fit_vertical(points: Float, axes: Float) -> tuple[Float, Float, Float]:
    along, up = along_horizontal(points, axes), axes[2]
    return np.array([along, up, np.cross(along, up)]), points.mean(axis=0), np.zeros(2)


PLANE_SHAPE = Shape("plane", ("tilt 1", "tilt 2", "offset"), 1, _plane, _fit_plane)
VERTICAL = Shape("vertical_plane", ("turn", "offset"), 1, _vertical, _fit_vertical, TILT)


def _level(source: ObservationSource, conditions: Conditions) -> Observed:
    """Points of one height, which is unknown; it counts from where the heights of the block do."""
    level, point, condition, n = source.level, conditions.point[:, 0], conditions.of, len(conditions.row)
    reduced_by = 0.0 if level.curved else float(source.origin_m[2])

    def evaluate(state: State, rows: Int) -> tuple[Float, tuple[Float, ...]]:
        h, by_point = level.height(state[POINT][point[rows]])
        v = h + reduced_by - state[conditions.group][condition[rows], 0]
        return v[:, None], (by_point[:, None, :], -np.ones((len(rows), 1, 1)))

    def generator(state: State) -> Float:
        placed = np.flatnonzero(finite_rows(state[POINT][point]))
        _, by_point = level.height(state[POINT][point[placed]])
        moves = (by_point[:, None, :] @ point_generator(state)[point[placed]])[:, 0]
        return means(moves, condition[placed], n)[:, None, :]

    placed = np.flatnonzero(finite_rows(source.start[POINT][point]))
    start = means(level.height(source.start[POINT][point[placed]])[0][:, None], condition[placed], n)
    sees = ALL if level.curved else HEIGHT
    return conditions.observed(evaluate, start + reduced_by, ("height",), generator, seeing(TILT), sees=sees)
