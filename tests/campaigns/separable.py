"""Which right rays no test can tell from the wrong ones of their point, orientation and truth known.

A point has rays with B_i = d(xy)/dX / sigma and the gross errors e_i / sigma of the wrong ones. A set S of rays
explains them if the others agree without it,

    min over X of sum_(i not in S) |e_i - B_i X|^2  <=  SEPARABLE above the least,

and the fewest rays that do are named. Two rays of a point always explain the same: each alone agrees with anything.
Of three on one line of flight each explains an error along it. Source: docs/formulas.md 7.3.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from aatri.adjustment.statistics.limits import SEPARABLE
from aatri.arrays import Float, Int
from aatri.geometry.collinearity import collinearity
from tests.stages.chain import Chain

MOST_SETS = 3000
"""Sets of one size that are tried at a point."""


def inseparable(clean: Chain, spoilt: Chain, rows: Int) -> Int:
    """Right image points that explain the wrong ones (`rows`) of their points as well as those do."""
    block, truth, poses = clean.block, clean.block.true_points, clean.bundle.images
    assert truth is not None
    xyz_m = np.full((len(block.points), 3), np.nan)
    xyz_m[truth.point] = truth.xyz_m
    m, before = block.image_points, clean.refined.measurements
    c_mm = block.cameras.principal_distance_mm[block.images.camera[m.image]]
    _, _, by_point = collinearity(poses.position_m[m.image], poses.ground_from_image[m.image], xyz_m[m.point], c_mm)
    B, e = by_point / m.sigma_mm[:, :, None], np.zeros((len(m), 2))
    e[rows] = (spoilt.refined.measurements.xy_mm[rows] - before.xy_mm[rows]) / m.sigma_mm[rows]
    controlled = block.ground_points.point[(block.ground_points.role == 1).any(axis=1)]
    named = [
        of_point[explaining(B[of_point], e[of_point])]
        for point in np.setdiff1d(m.point[rows], controlled)
        for of_point in [np.flatnonzero(m.point == point)]
    ]
    return np.setdiff1d(np.concatenate([np.zeros(0, np.int64), *named]), rows)


def explaining(B: Float, e: Float) -> Int:
    """Places of the rays in the smallest sets that explain the errors; none where they agree with them."""
    n = len(B)
    for size in range(n):
        sets = list(combinations(range(n), size))
        if len(sets) > MOST_SETS:
            break
        cost = np.array([_cost(np.delete(B, s, axis=0), np.delete(e, s, axis=0)) for s in sets])
        if cost.min() <= SEPARABLE:
            near = [s for s, value in zip(sets, cost) if value <= cost.min() + SEPARABLE]
            return np.unique(np.array([k for s in near for k in s], dtype=np.int64))
    return np.zeros(0, dtype=np.int64)


def _cost(B: Float, e: Float) -> float:
    rows, right = B.reshape(-1, 3), e.ravel()
    return float(np.sum((right - rows @ np.linalg.lstsq(rows, right, rcond=1e-10)[0]) ** 2))
