"""Figures of a sample of differences: RMSE, bias, largest, the chi-square interval of an RMSE, the convex hull.

For n independent normal differences of standard deviation sigma and mean 0, n RMSE^2 / sigma^2 is chi-square with n
degrees of freedom. The interval of sigma at confidence P is therefore

    RMSE sqrt(n / chi2_{n, (1+P)/2})  ...  RMSE sqrt(n / chi2_{n, (1-P)/2}).

A bias makes it too wide, correlation between neighbouring points too narrow. Columns are taken one by one; NaN is a
coordinate that does not take part, and a column without any gives NaN.
"""

import numpy as np

from aatri.arrays import Bool, Float, Int


def counts(differences: Float) -> Int:
    """Number of values in each column, (k,) int64, of (n, k)."""
    return np.asarray(np.isfinite(differences).sum(axis=0))


def rmse(differences: Float) -> Float:
    """Root mean square of each column, (k,) float64, of (n, k).

    Examples
    --------
    >>> rmse(np.array([[3.0, 0.0], [-3.0, 4.0]])).round(3)
    array([3.   , 2.828])
    """
    return np.sqrt(bias(differences**2))


def bias(differences: Float) -> Float:
    """Mean of each column, (k,) float64, of (n, k)."""
    n = counts(differences)
    return np.where(n > 0, np.nansum(differences, axis=0) / np.maximum(n, 1), np.nan)


def largest(differences: Float) -> Float:
    """Largest absolute value of each column, (k,) float64, of (n, k)."""
    size = np.where(np.isfinite(differences), np.abs(differences), -1.0)
    top = size.max(axis=0, initial=-1.0)
    return np.where(top < 0, np.nan, top)


def rmse_interval(rmse_m: Float, n: Int | Float, confidence: float) -> tuple[Float, Float]:
    """Chi-square interval of the standard deviation behind an RMSE about zero.

    Parameters
    ----------
    rmse_m : (k,) float64
    n : (k,) int64 or float64
        Number of differences, or degrees of freedom.
    confidence : float
        Probability of the interval, 0 to 1.

    Returns
    -------
    low, high : (k,) float64

    Examples
    --------
    Of ten check points an RMSE of 10 mm says that the standard deviation is 7 to 18 mm:

    >>> low, high = rmse_interval(np.array([10.0]), np.array([10]), 0.95)
    >>> low.round(1), high.round(1)
    (array([7.]), array([17.5]))
    """
    from scipy.special import chdtri  # inverse of the upper tail

    dof = np.maximum(n, 1)
    low = rmse_m * np.sqrt(dof / chdtri(dof, (1.0 - confidence) / 2))
    high = rmse_m * np.sqrt(dof / chdtri(dof, (1.0 + confidence) / 2))
    return np.where(n > 0, low, np.nan), np.where(n > 0, high, np.nan)


def outside_hull(plan_m: Float, corners_m: Float) -> Bool | None:
    """Which points lie outside the convex hull of others, in plan.

    Parameters
    ----------
    plan_m : (n, 2) float64, m
        Points asked about; NaN counts as inside.
    corners_m : (m, 2) float64, m
        Points that span the hull.

    Returns
    -------
    (n,) bool, or None
        None if the others span no area.

    Examples
    --------
    >>> square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    >>> outside_hull(np.array([[0.5, 0.5], [2.0, 0.5]]), square)
    array([False,  True])
    """
    from scipy.spatial import ConvexHull, QhullError

    corners = corners_m[np.isfinite(corners_m).all(axis=1)]
    if len(corners) < 3:
        return None
    centre = corners.mean(axis=0)
    extent = float(np.abs(corners - centre).max())
    try:
        normals = ConvexHull((corners - centre) / (extent or 1.0)).equations
    except QhullError:
        return None
    distance = (plan_m - centre) / extent @ normals[:, :2].T + normals[:, 2]
    return np.asarray((distance > 1e-9).any(axis=1))
