"""Differences solution minus given at control and check points, and solution minus truth at new points.

Only what is determined takes part: a coordinate the solution has, of a point with image points or geodetic
observations of its own (a control point nobody measured agrees with itself). A control coordinate the adjustment
rejected takes no part in the control figures; it is counted apart. New points are those without control role in any
coordinate: check points are new points.

The theoretical standard deviation belongs to the difference where both sides are independent (check: solution and
given; truth: solution), and to the adjusted coordinate at control points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Bool, Float, Int, diagonals
from aatri.artifacts.block import CHECK, CONTROL, Block
from aatri.artifacts.solution import Solution
from aatri.ids import rows_of


@dataclass(frozen=True)
class PointDifferences:
    """Differences at points of one kind; rows as in `points` of the Block."""

    point: Int
    """(n,) int32."""
    difference_m: Float
    """(n, 3), m. NaN where a coordinate takes no part."""
    sigma_m: Float
    """(n, 3), m. NaN where unknown."""

    def take(self, rows: Bool) -> PointDifferences:
        """The chosen rows."""
        return PointDifferences(self.point[rows], self.difference_m[rows], self.sigma_m[rows])


NO_DIFFERENCES = PointDifferences(np.zeros(0, np.int32), np.zeros((0, 3)), np.zeros((0, 3)))


def control_differences(block: Block, solution: Solution) -> PointDifferences:
    """Solution minus given at control coordinates, the rejected ones included."""
    ground = block.ground_points
    measured = ((solution.points.rays > 0) | _of_geodetic_observations(block, solution))[ground.point]
    variance = diagonals(solution.points.covariance_m2)[ground.point]
    return _differences(block, solution, (ground.role == CONTROL) & measured[:, None], variance)


def check_differences(block: Block, solution: Solution) -> PointDifferences:
    """Solution minus given at check coordinates."""
    ground = block.ground_points
    variance = diagonals(solution.points.covariance_m2[ground.point] + ground.covariance_m2)
    return _differences(block, solution, ground.role == CHECK, variance)


def truth_differences(block: Block, solution: Solution) -> PointDifferences:
    """Solution minus truth at new points with all three coordinates; empty without truth."""
    if block.true_points is None:
        return NO_DIFFERENCES
    point = block.true_points.point
    difference = solution.points.xyz_m[point] - block.true_points.xyz_m
    rows = is_new(block)[point] & np.isfinite(difference).all(axis=1)
    sigma = np.sqrt(diagonals(solution.points.covariance_m2))[point]
    return PointDifferences(point, difference, sigma).take(rows)


def is_new(block: Block) -> Bool:
    """Which points of the Block have no control role in any coordinate.

    Returns
    -------
    (n,) bool
    """
    return ~block.points_given_as(CONTROL)


def rejected_control(block: Block, solution: Solution) -> Int:
    """Rows in `points` of control points the adjustment rejected."""
    residuals = solution.residuals
    rows = residuals.of_kind("control")
    rows = rows[~residuals.active[rows]]
    return np.unique(rows_of(residuals.point[rows], block.points.id))


def _of_geodetic_observations(block: Block, solution: Solution) -> Bool:
    """Points between which the adjustment took geodetic observations, (n,) bool."""
    g, residuals = block.geodetic, solution.residuals
    adjusted = (residuals.row >= 0) & (residuals.image == "") & (residuals.point != "") & (residuals.kind != "control")
    if not adjusted.any():
        return np.zeros(len(block.points), dtype=bool)
    return np.asarray(np.isin(block.points.id, np.concatenate([names[g.active] for names in (g.start, g.end, g.via)])))


def _differences(block: Block, solution: Solution, takes_part: Bool, variance: Float) -> PointDifferences:
    ground = block.ground_points
    difference = np.where(takes_part, solution.points.xyz_m[ground.point] - ground.xyz_m, np.nan)
    sigma = np.where(takes_part, np.sqrt(variance), np.nan)
    rows = np.asarray(np.isfinite(difference).any(axis=1))
    return PointDifferences(ground.point, difference, sigma).take(rows)
