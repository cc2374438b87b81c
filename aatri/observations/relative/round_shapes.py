"""Points of a sphere or a cylinder, of known or unknown radius.

    sphere    v = |x - m| - r
    cylinder  v = |(a'x - p, b'x - q)| - r,   a, b across its axis as of a line

Source: docs/formulas.md 5.5.
"""

import numpy as np

from aatri.arrays import Float
from aatri.observations.observed import ObservationSource, Observed
from aatri.observations.relative.lines import across
from aatri.observations.relative.shapes import Shape, main_axes, observed_shapes

_CORNERS = np.array(
    [
        [1, 0, 0],
        [0, 1, 0],
        [0, 0, 1],
        [1, 1, 0],
        [1, -1, 0],
        [1, 0, 1],
        [1, 0, -1],
        [0, 1, 1],
        [0, 1, -1],
        [1, 1, 1],
        [1, 1, -1],
        [1, -1, 1],
        [-1, 1, 1],
    ],
    dtype=np.float64,
)
DIRECTIONS = _CORNERS / np.linalg.norm(_CORNERS, axis=1, keepdims=True)
"""Axes of a cylinder that are tried, in those of the extent of its points."""

USES = ("relative_control:sphere", "relative_control:cylinder")


def round_shapes(source: ObservationSource) -> tuple[Observed, ...]:
    """Points of spheres and cylinders."""
    return tuple(o for shape in (SPHERE, CYLINDER) for o in observed_shapes(source, shape))


def _sphere(x: Float, t: Float) -> tuple[Float, Float, Float]:
    away = x - t[:, :3]
    distance = np.linalg.norm(away, axis=1)
    u = away / distance[:, None]
    return (distance - t[:, 3])[:, None], u[:, None, :], np.column_stack([-u, -np.ones(len(x))])[:, None, :]


def _cylinder(x: Float, t: Float) -> tuple[Float, Float, Float]:
    offset, by_x, by_turn = across(x, t[:, :2])
    offset = offset - t[:, 2:4]
    distance = np.linalg.norm(offset, axis=1)
    u = (offset / distance[:, None])[:, None, :]
    return (distance - t[:, 4])[:, None], u @ by_x, np.concatenate([u @ by_turn, -u, -np.ones((len(x), 1, 1))], axis=2)


def _fit_sphere(points: Float, _axes: Float, radius_m: float = np.nan) -> tuple[Float, Float, Float]:
    """|x|^2 = 2 m'x + (r^2 - m^2): linear."""
    centre = points.mean(axis=0)
    x = points - centre
    m = np.linalg.lstsq(np.column_stack([2 * x, np.ones(len(x))]), (x**2).sum(axis=1), rcond=None)[0]
    own = np.sqrt(max(m[3] + m[:3] @ m[:3], 1e-12))
    return np.eye(3), centre, np.array([*m[:3], radius_m if np.isfinite(radius_m) else own])


def _fit_cylinder(points: Float, _axes: Float, radius_m: float = np.nan) -> tuple[Float, Float, Float]:
    """The best of many axes: those of the extent of the points, and the middles between them."""
    centre, main = points.mean(axis=0), main_axes(points)
    best, cylinder = np.inf, (main, np.zeros(5))
    fixed_radius, first = np.isfinite(radius_m), main[:, 0]
    for direction in DIRECTIONS:
        along = direction @ main
        across_it = np.cross(along, first if abs(along @ first) < 0.9 else main[:, 1])
        across_it /= np.linalg.norm(across_it)
        F = np.array([across_it, np.cross(along, across_it), along])
        x = (points - centre) @ F.T
        plan = x[:, :2]
        m = np.linalg.lstsq(np.column_stack([2 * plan, np.ones(len(x))]), (plan**2).sum(axis=1), rcond=None)[0]
        own = np.sqrt(max(m[2] + m[:2] @ m[:2], 1e-12))
        start = np.array([0.0, 0.0, m[0], m[1], radius_m if fixed_radius else own])

        def linearised(t: Float, x: Float = x, start: Float = start) -> tuple[Float, Float]:
            v, _, by_t = _cylinder(x, np.tile([*t, *start[len(t) :]], (len(x), 1)))
            return v[:, 0], by_t[:, 0, : len(t)]

        from scipy.optimize import least_squares  # takes a tenth of a second to import

        estimated = start[: 4 if fixed_radius else 5]
        fitted = least_squares(lambda t, f=linearised: f(t)[0], estimated, jac=lambda t, f=linearised: f(t)[1])
        if fitted.cost < best:
            best, cylinder = fitted.cost, (F, np.array([*fitted.x, *start[len(fitted.x) :]]))
    return cylinder[0], centre, cylinder[1]


SPHERE = Shape("sphere", ("centre 1", "centre 2", "centre 3", "radius"), 1, _sphere, _fit_sphere, radius=True)
CYLINDER = Shape(
    "cylinder", ("turn 1", "turn 2", "offset 1", "offset 2", "radius"), 1, _cylinder, _fit_cylinder, radius=True
)
