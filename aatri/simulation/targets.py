"""Where ground points lie: standard (Gruber) positions, random places, and the layout of control.

Standard positions are below every station on its strip axis and half a strip spacing to either side, so that those of
neighbouring images and strips coincide: in the image x in {-b, 0, b}, y in {-s/2, 0, s/2}.
Control lies on a regular net from edge to edge of the block: perimeter, and chains inside.
"""

import numpy as np

from aatri.arrays import Float
from aatri.simulation.flight import FlightPlan


def standard_positions(plan: FlightPlan) -> Float:
    """Plan coordinates of the standard positions, each once: (n, 2), m."""
    left = np.stack([-np.sin(plan.heading_rad), np.cos(plan.heading_rad)], axis=1)
    rows = [plan.position_m[:, :2] + step * plan.spacing_m * left for step in (-0.5, 0.0, 0.5)]
    return np.unique(np.round(np.concatenate(rows), 3) + 0.0, axis=0)


def standard_rows(plan: FlightPlan) -> list[Float]:
    """The standard positions row by row from north to south, each from west to east: (n, 2) each, m."""
    xy = standard_positions(plan)
    north = np.unique(np.round(xy[:, 1], 2))[::-1]
    rows = [xy[np.abs(xy[:, 1] - y) < 0.1] for y in north]
    return [row[np.argsort(row[:, 0])] for row in rows]


def extent(plan: FlightPlan) -> tuple[Float, Float]:
    """Lowest and highest plan coordinates of the standard positions of the parallel strips, m."""
    if plan.area is not None:
        return plan.area
    parallel = plan.position_m[np.abs(np.sin(plan.heading_rad)) < 0.5, :2]
    edge = np.array([0.0, 0.5 * plan.spacing_m])
    return parallel.min(axis=0) - edge, parallel.max(axis=0) + edge


def clusters(positions_m: Float, points: int, half_side_m: float, rng: np.random.Generator) -> Float:
    """Points in a square about each position: (n * points, 2), m."""
    return np.repeat(positions_m, points, axis=0) + half_side_m * rng.uniform(-1.0, 1.0, (points * len(positions_m), 2))


def scattered(low_m: Float, high_m: Float, points: int, rng: np.random.Generator) -> Float:
    """Points anywhere in a rectangle: (points, 2), m."""
    return rng.uniform(low_m, high_m, (points, 2))


def net(low_m: Float, high_m: Float, points: int) -> Float:
    """An even net of exactly so many points over a rectangle, edges included: (points, 2), m.

    Points next to the corners come first, then those at the edges, then the inner ones.
    """
    if points == 0:
        return np.zeros((0, 2))
    size = high_m - low_m
    rows = int(np.clip(round(np.sqrt(points * size[1] / size[0])) if size[0] > 0 else points, 1, points))
    rows = max(rows, min(2, points // 2))
    counts = [points // rows + (row < points % rows) for row in range(rows)]
    y = np.linspace(0.0, 1.0, rows) if rows > 1 else np.array([0.5])
    unit = np.concatenate([np.column_stack([_even(n), np.full(n, y[row])]) for row, n in enumerate(counts)])
    to_edge = np.minimum(unit, 1 - unit)
    order = np.lexsort((unit[:, 0], unit[:, 1], to_edge.sum(axis=1), to_edge.min(axis=1)))
    return low_m + unit[order] * size


def _even(n: int) -> Float:
    return np.linspace(0.0, 1.0, n) if n > 1 else np.array([0.5])
