"""Weighted means of ground points over the bodies that hold them."""

import numpy as np

from aatri.arrays import Bool, Float, Int, sums_of


def weighted_means(point: Int, xyz: Float, T: Float, use: Bool, n_points: int) -> tuple[Float, Float]:
    """Weighted means of the bodies' points.

    Parameters
    ----------
    point : (n,) int
    xyz : (n, 3) float64, m
    T : (n, 3, 3) float64, 1/m
        Whitener of each.
    use : (n,) bool
    n_points : int

    Returns
    -------
    mean : (n_points, 3) float64, m
        NaN where no body holds the point.
    covariance : (n_points, 3, 3) float64, m^2
    """
    point, W = point[use], T[use].swapaxes(1, 2) @ T[use]
    total = sums_of(W, point, n_points)
    observed = np.bincount(point, minlength=n_points) > 0
    total[~observed] = np.eye(3)
    covariance: Float = np.linalg.inv(total).astype(np.float64)
    mean = np.einsum("nij,nj->ni", covariance, sums_of(np.einsum("nij,nj->ni", W, xyz[use]), point, n_points))
    mean[~observed], covariance[~observed] = np.nan, np.nan
    return mean, covariance
