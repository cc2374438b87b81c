"""Points of one line: any, plumb, horizontal. Two residuals a point, the distances across the line.

    line        v = (a'x - p, b'x - q),   a = (1, 0, -t1) / s,   b = (-t1 t2, s^2, -t2) / (s l)
                s^2 = 1 + t1^2,   l^2 = s^2 + t2^2,   direction (t1, t2, 1) / l
    plumb line  v = (x - p, y - q)
    horizontal  v = ((x - t z) / sqrt(1 + t^2) - p, y - q),   y the vertical

x, y, z are coordinates in the axes of the line at the start, its direction the last (plumb line: the vertical). Two
residuals across the line have rank 2 whatever its direction, unlike the determinants of the lecture notes, which lose
one for lines across the X axis. Source: docs/formulas.md 5.5.
"""

import numpy as np

from aatri.arrays import Float
from aatri.observations.observed import ObservationSource, Observed
from aatri.observations.relative.shapes import TILT, TILT_ACROSS, Shape, along_horizontal, main_axes, observed_shapes

USES = tuple(f"relative_control:{t}" for t in ("line", "plumb_line", "horizontal_line"))


def lines(source: ObservationSource) -> tuple[Observed, ...]:
    """Points of lines."""
    return tuple(o for shape in (LINE, PLUMB, HORIZONTAL) for o in observed_shapes(source, shape))


def across(x: Float, t: Float) -> tuple[Float, Float, Float]:
    """Coordinates across a line of direction (t1, t2, 1) through the origin, (n, 2), by x and by t."""
    t1, t2 = t[:, 0], t[:, 1]
    s, size = np.sqrt(1 + t1**2), np.sqrt(1 + t1**2 + t2**2)
    zero, one = np.zeros_like(t1), np.ones_like(t1)
    a = np.column_stack([one, zero, -t1]) / s[:, None]
    b = np.column_stack([-t1 * t2, s**2, -t2]) / (s * size)[:, None]
    da1 = np.column_stack([zero, zero, -one]) / s[:, None] - a * (t1 / s**2)[:, None]
    db1 = np.column_stack([-t2, 2 * t1, zero]) / (s * size)[:, None] - b * (t1 / s**2 + t1 / size**2)[:, None]
    db2 = np.column_stack([-t1, zero, -one]) / (s * size)[:, None] - b * (t2 / size**2)[:, None]
    by_x = np.stack([a, b], axis=1)
    by_t = np.zeros((len(x), 2, 2))
    by_t[:, 0, 0] = np.einsum("ni,ni->n", da1, x)
    by_t[:, 1, 0], by_t[:, 1, 1] = np.einsum("ni,ni->n", db1, x), np.einsum("ni,ni->n", db2, x)
    return np.einsum("nij,nj->ni", by_x, x), by_x, by_t


def _line(x: Float, t: Float) -> tuple[Float, Float, Float]:
    v, by_x, by_t = across(x, t)
    return v - t[:, 2:], by_x, np.concatenate([by_t, np.tile(-np.eye(2), (len(x), 1, 1))], axis=2)


def _plumb(x: Float, t: Float) -> tuple[Float, Float, Float]:
    n = len(x)
    return x[:, :2] - t, np.tile(np.eye(3)[:2], (n, 1, 1)), np.tile(-np.eye(2), (n, 1, 1))


def _horizontal(x: Float, t: Float) -> tuple[Float, Float, Float]:
    turned = np.column_stack([t[:, 0], np.zeros(len(t))])
    v, by_x, by_t = across(x, turned)
    by_own = np.concatenate([by_t[:, :, :1], np.tile(-np.eye(2), (len(x), 1, 1))], axis=2)
    return v - t[:, 1:], by_x, by_own


def _fit_line(points: Float, _axes: Float) -> tuple[Float, Float, Float]:
    return main_axes(points)[[1, 2, 0]], points.mean(axis=0), np.zeros(4)


def _fit_plumb(points: Float, axes: Float) -> tuple[Float, Float, Float]:
    return axes, points.mean(axis=0), np.zeros(2)


def _fit_horizontal(points: Float, axes: Float) -> tuple[Float, Float, Float]:
    along, up = along_horizontal(points, axes), axes[2]
    return np.array([np.cross(along, up), up, along]), points.mean(axis=0), np.zeros(3)


LINE = Shape("line", ("turn 1", "turn 2", "offset 1", "offset 2"), 2, _line, _fit_line)
PLUMB = Shape("plumb_line", ("east", "north"), 2, _plumb, _fit_plumb, TILT)
HORIZONTAL = Shape("horizontal_line", ("turn", "offset", "height"), 2, _horizontal, _fit_horizontal, TILT_ACROSS)
