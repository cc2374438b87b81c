"""Weights of ties and of what is observed of the ground, with the variance that bodies are deformed by; means by them.

Bodies are deformed: their points disagree by more than their covariances C_o say. tau is what must be added,
W_o = (C_o + tau^2 I)^-1. What is exact, or far better than any point of a body, gets a standard deviation of `EXACT`
times that of these.

tau is one for all bodies and ties, and the end of a long strip at the edge of a block bends more (`bent`). There all
ties are off together, and smoothly.
"""

import numpy as np
from scipy.spatial import cKDTree

from aatri.adjusting.limits import BORDER_TIES, STEEPEST_BEND
from aatri.adjustment.statistics.limits import SINGLE_LIMIT
from aatri.adjustment.whitening import inverse_cholesky
from aatri.arrays import Bool, Float, Int, sums_of
from aatri.observations.observed import NEARLY_EXACT, Observed, Spread

EXACT = 1e-2
"""Standard deviation of exact control, as a share of that of the bodies' points: its residuals stay below 1e-4 of the
discrepancies, and its redundancy can still be told from rounding."""

NEIGHBOURS = 6
"""Nearest ties of an overlap that say how a body bends at one of them: two wrong ones do not move their median far."""

MEDIAN_OF_NEIGHBOURS = float(np.pi / 2 / NEIGHBOURS)
"""Variance of the median of so many normal errors."""


def tie_whitener(spread: Spread, tau_m: float) -> Float:
    """T with T'T = (C + tau^2 I)^-1; of equal weights where there is neither."""
    values = spread.values + tau_m**2
    if not values.any():
        values = np.ones_like(values)
    return np.divide(spread.vectors.swapaxes(1, 2), np.sqrt(values)[:, :, None], order="C")


def typical_variance(spread: Spread, tau_m: float) -> float:
    """Median variance of a coordinate of the bodies' points, m^2; 1 where they have none."""
    values = spread.values
    variance = float(np.median(values @ np.full(3, 1 / 3))) + tau_m**2 if len(values) else 0.0
    return variance or 1.0


def observed_components(o: Observed) -> Bool:
    """Components that are observed or exact, (n, m)."""
    return np.asarray(o.records.observed_components() | o.demanded())


def whitener_beside(o: Observed, covariance: Float, typical_m2: float) -> Float:
    """T with T'T = C^-1 of observations beside points of bodies; rows of what is not observed are zero.

    Parameters
    ----------
    covariance : (n, m, m) float64
        A priori, zero where exact.
    typical_m2 : float, m^2
        Typical variance of a coordinate of a body's point.
    """
    used, m = observed_components(o), o.records.rows
    least = EXACT**2 * typical_m2 if o.unit == "m" else NEARLY_EXACT**2  # angles know nothing of lengths
    exact = np.einsum("nii->ni", covariance) < least
    C = covariance + np.where(exact, least, 0.0)[:, :, None] * np.eye(m)
    both = used[:, :, None] & used[:, None, :]
    return np.asarray(np.where(both, inverse_cholesky(np.where(both, C, np.eye(m))), 0.0))


def weighted_means(point: Int, xyz: Float, T: Float, use: Bool, n_points: int) -> tuple[Float, Float]:
    """Weighted means of ground points over the bodies that hold them.

    Parameters
    ----------
    point : (n,) int
    xyz : (n, 3) float64, m
    T : (n, 3, 3) float64, 1/m
        Whitener of each.
    use : (n,) bool

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


def bent(
    overlap: Int, xyz: Float, residual: Float, whitener: Float, redundancy: Float, test: Float, use: Bool, limit: float
) -> Bool:
    """Ties above the limit that are so because their body bends there, (n,).

    They are not off the median of their neighbours in the overlap, and the nearest ties below the limit are not far
    below it: a bend begins slowly, while ties that are wrong together begin at once. Or they agree with the nearest
    below the limit: what these do not say is no more than chance.

    Parameters
    ----------
    overlap : (n,) int
        Of a body with the others that have the point.
    xyz : (n, 3) float64, m
        Where they are.
    residual : (n, 3) float64, m
    whitener : (n, 3, 3) float64
    redundancy : (n, 3, 3) float64
        Of the whitened residuals.
    test : (n,) float64
        Test statistic; NaN of points in one body alone.
    """
    above, bends = use & (test > limit), np.zeros(len(overlap), dtype=bool)
    usable = np.flatnonzero(use & np.isfinite(test))
    usable = usable[np.argsort(overlap[usable], kind="stable")]
    for one in np.unique(overlap[above]).tolist():
        rows = usable[slice(*np.searchsorted(overlap[usable], [one, one + 1]))]
        asked, below = rows[above[rows]], rows[~above[rows]]
        if len(below) <= NEIGHBOURS:
            continue
        near = rows[cKDTree(xyz[rows, :2]).query(xyz[asked, :2], NEIGHBOURS + 1)[1]]
        beside = np.where((near == asked[:, None])[:, :, None], np.nan, residual[near])
        border = below[cKDTree(xyz[below, :2]).query(xyz[asked, :2], NEIGHBOURS)[1]]
        share = np.einsum("nii->ni", redundancy[asked]) * (1 + MEDIAN_OF_NEIGHBOURS)
        off, of_border = (
            np.abs(np.einsum("nij,nj->ni", whitener[asked], residual[asked] - np.nanmedian(others, axis=1)))
            / np.sqrt(np.maximum(share, np.finfo(float).tiny))
            for others in (beside, residual[border])
        )
        rises = np.median(test[border[:, :BORDER_TIES]], axis=1) > STEEPEST_BEND * limit
        bends[asked] = (off <= limit).all(axis=1) & rises | (of_border <= SINGLE_LIMIT).all(axis=1)
    return bends
