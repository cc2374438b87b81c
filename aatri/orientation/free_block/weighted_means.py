"""Weighted means of points over the strips that hold them."""

from __future__ import annotations

from typing import Any

import numpy as np

from aatri.arrays import Bool, Float
from aatri.orientation.free_block.tie_records import Ties


def weighted_means(ties: Ties[Any], xyz: Float, T: Float, use: Bool) -> tuple[Float, Float]:
    """Weighted means of the strips' points over the strips.

    Parameters
    ----------
    ties : Ties
    xyz : (n, 3) float64, m
    T : (n, 3, 3) float64, 1/m
        Whitener of each.
    use : (n,) bool

    Returns
    -------
    mean : (n_points, 3) float64, m
        NaN where no strip holds the point.
    covariance : (n_points, 3, 3) float64, m^2
    """
    point, W = ties.point[use], T[use].swapaxes(1, 2) @ T[use]
    total = _summed(W, point, ties.n_points)
    held = np.bincount(point, minlength=ties.n_points) > 0
    total[~held] = np.eye(3)
    covariance: Float = np.linalg.inv(total).astype(np.float64)
    mean = np.einsum("nij,nj->ni", covariance, _summed(np.einsum("nij,nj->ni", W, xyz[use]), point, ties.n_points))
    mean[~held], covariance[~held] = np.nan, np.nan
    return mean, covariance


def _summed(values: Float, point: Any, n_points: int) -> Float:
    flat = values.reshape(len(values), -1)
    sums: Float = np.stack([np.bincount(point, column, n_points).astype(np.float64) for column in flat.T], axis=1)
    return sums.reshape(n_points, *values.shape[1:])
