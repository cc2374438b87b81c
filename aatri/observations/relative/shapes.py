"""Points on a shape: planes, lines, spheres, whose places are latent unknowns, so that no point is set apart.

    v = shape(F (X - c), t),    F, c: axes and centre of the shape at the start, t its unknowns

With the shape eliminated the redundancy gained is the count of conditions between the points alone (m points: plane
m - 3, vertical plane m - 2, horizontal plane m - 1, line 2 (m - 2), plumb line 2 (m - 1), horizontal line 2 m - 3). A
residual is the distance of a point from the shape. Source: lecture notes on close range, 5-7, with the line put right;
docs/formulas.md 5.5.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from aatri.adjustment.records import Evaluated
from aatri.adjustment.unknowns import State
from aatri.arrays import Float, Int, finite_rows
from aatri.observations.limits import MOST_TILT
from aatri.observations.observed import ObservationSource, Observed
from aatri.observations.poses import POINT, point_generator
from aatri.observations.relative.members import Conditions, observed_conditions

Equation = Callable[[Float, Float], tuple[Float, Float, Float]]
"""(local coordinates (n, 3), unknowns (n, k)) -> v (n, m), by coordinates (n, m, 3), by unknowns (n, m, k)."""

Fit = Callable[..., tuple[Float, Float, Float]]
"""(points (n, 3), axes east, north, up (3, 3), of round shapes the radius or NaN) -> axes F (3, 3), centre c (3,),
unknowns (k,)."""

TURNS = ("tilt", "turn")
NOTHING, TILT, TILT_ACROSS = "nothing", "tilt", "tilt across"
"""What a condition can see of a movement of the block: nothing, tilts, or the tilt about the axis across it."""


def seeing(what: str) -> Evaluated:
    """Projectors (n, 7, 7) of shifts, rotations and scale onto what is seen: nothing, or tilts."""
    projector = np.zeros((7, 7))
    projector[3, 3] = projector[4, 4] = 1.0 if what == TILT else 0.0
    return lambda _, rows: np.broadcast_to(projector, (len(rows), 7, 7))


@dataclass(frozen=True)
class Shape:
    """A kind of shape."""

    type: str
    """Of relative_control.yaml; name of the kind and of the group of unknowns."""
    labels: tuple[str, ...]
    """Names of its unknowns."""
    rows: int
    """Residuals of a point."""
    equation: Equation
    fit: Fit
    sees: str = NOTHING
    """NOTHING, TILT or TILT_ACROSS."""
    radius: bool = False
    """The last unknown is a radius, held where it is given."""


def observed_shapes(source: ObservationSource, shape: Shape) -> tuple[Observed, ...]:
    """The conditions of one type, observed and exact ones apart."""
    return tuple(observed_conditions(source, shape.type, lambda start, conditions: _observed(start, shape, conditions)))


def _observed(source: ObservationSource, shape: Shape, conditions: Conditions) -> Observed:
    point, condition, group, n = conditions.point[:, 0], conditions.of, conditions.group, len(conditions.row)
    radius = source.block.relative_control.value[conditions.row]
    F, c, t = _started(source, shape, [point[condition == k] for k in range(n)], radius)
    free = np.ones(t.shape, dtype=bool)
    if shape.radius:
        fixed = np.isfinite(radius)
        t[fixed, -1], free[fixed, -1] = radius[fixed], False

    def evaluate(state: State, rows: Int) -> tuple[Float, tuple[Float, ...]]:
        own = condition[rows]
        local = np.einsum("nij,nj->ni", F[own], state[POINT][point[rows]] - c[own])
        v, by_local, by_shape = shape.equation(local, state[group][own])
        return v, (by_local @ F[own], by_shape)

    def generator(state: State) -> Float:
        """How the shapes go with their points, (n, k, 7): by least squares over the points of each."""
        placed = np.flatnonzero(finite_rows(state[POINT][point]))
        _, (by_point, by_shape) = evaluate(state, placed)
        along = by_point @ point_generator(state)[point[placed]]
        moves = np.zeros((n, t.shape[1], 7))
        for k in range(n):
            of_shape, free_ones = condition[placed] == k, np.flatnonzero(free[k])
            A = by_shape[of_shape].reshape(-1, t.shape[1])[:, free_ones]
            moves[k, free_ones] = -np.linalg.lstsq(A, along[of_shape].reshape(-1, 7), rcond=None)[0]
        return moves

    def tilt_across(state: State, rows: Int) -> Float:
        """The tilt about the first residual's axis: of a horizontal line that across it."""
        axis = evaluate(state, rows)[1][0][:, 0]
        projectors = np.zeros((len(rows), 7, 7))
        projectors[:, 3:6, 3:6] = axis[:, :, None] * axis[:, None, :]
        return projectors

    seen = tilt_across if shape.sees == TILT_ACROSS else seeing(shape.sees)
    steep = np.array([MOST_TILT if name.startswith(TURNS) else np.inf for name in shape.labels])
    return conditions.observed(
        evaluate, t, shape.labels, generator, seen, rows=shape.rows, free=free, implausible=steep
    )


def _started(source: ObservationSource, shape: Shape, points: list[Int], radius_m: Float) -> tuple[Float, Float, Float]:
    """Axes, centres and unknowns of the shapes from the start of their points."""
    xyz = source.start[POINT]
    fitted = []
    for rows, radius in zip(points, radius_m.tolist()):
        placed = xyz[rows][finite_rows(xyz[rows])]
        placed = placed if len(placed) else np.zeros((1, 3))
        axes = source.level.axes(placed.mean(axis=0)[None])[0][0]
        fitted.append(shape.fit(placed, axes, radius) if shape.radius else shape.fit(placed, axes))
    F, c, t = (np.array(part) for part in zip(*fitted))
    return F, c, t


def main_axes(points: Float) -> Float:
    """Axes of the extent of points about their mean, rows, the longest first, (3, 3)."""
    _, _, axes = np.linalg.svd(points - points.mean(axis=0))
    return np.asarray(axes)


def along_horizontal(points: Float, axes: Float) -> Float:
    """The horizontal direction in which points extend most, (3,)."""
    plan = (points - points.mean(axis=0)) @ axes[:2].T
    _, _, main = np.linalg.svd(plan)
    return np.asarray(main[0] @ axes[:2])
