"""Reliability of observations: redundancy numbers, test statistics, minimal detectable gross errors.

For a record with covariance S and residual cofactor Qvv = S - J Q J',

    r_i = (Qvv S^-1)_ii,    w_i = (S^-1 v)_i / q_i,    nabla_i = delta0 / q_i,    q_i = sqrt((S^-1 Qvv S^-1)_ii),

which for independent components is w = v / (sigma sqrt(r)), nabla = delta0 sigma / sqrt(r). The r_i of all
observations sum to the redundancy; of correlated ones a single r_i may lie outside 0 to 1. A component with r below
`UNCONTROLLED` has neither test nor detectable error.

External reliability: an error nabla_i that is just not found moves the unknowns by dx = Q J' S^-1 e_i nabla_i; seen by
all of them, and free of any datum, that is

    delta_i = sqrt(dx' Q^-1 dx) = nabla_i sqrt((S^-1 - S^-1 Qvv S^-1)_ii)  ( = delta0 sqrt((1 - r_i) / r_i) )

so many standard deviations at most of any function of the unknowns (Baarda's lambda-bar, Foerstner's delta-bar).
Single blocks are moved by K L e_i nabla_i, with their gain K (`covariance.gains`) and the whitener L.

Source: Baarda 1968; Foerstner 1979, 1980; docs/formulas.md 7.3.

The tau test is of a residual standardised by the sigma0 of its own adjustment.

    tau = w / sigma0,    tau^2 r / (r - tau^2) (r - 1) / r = t^2,    tau_crit = t sqrt(r) / sqrt(r - 1 + t^2)

w is standardised by the sigmas a priori, r is the redundancy, t the quantile of Student's distribution with r - 1
degrees of freedom at the level of the limit of |w|.

Source: Pope 1976, The statistics of residuals and the detection of outliers.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, stdtrit

from aatri.adjustment.kernels.snooping import UNCONTROLLED as UNCONTROLLED
from aatri.adjustment.statistics.limits import DELTA0
from aatri.arrays import Float


def tau_limit(limit: float, redundancy: int) -> float:
    """Limit of |tau| at the level at which `limit` is that of |w|; infinite where nothing can be tested.

    Parameters
    ----------
    limit : float
        In standard deviations.
    """
    if redundancy < 2:
        return float("inf")
    quantile = -float(stdtrit(redundancy - 1, ndtr(-limit)))
    return float(quantile * np.sqrt(redundancy) / np.sqrt(redundancy - 1 + quantile**2))


@dataclass(frozen=True)
class Reliability:
    """Reliability of n records of m components."""

    redundancy: Float
    test: Float
    detectable: Float
    """(n, m). `detectable` in the unit of the observation; the last two NaN where uncontrolled."""
    external: Float
    """(n, m). delta-bar: largest effect of a detectable error on any function of the unknowns, in its standard
    deviations."""


def reliability(residual: Float, covariance: Float, adjusted_covariance: Float) -> Reliability:
    """Reliability of records.

    Parameters
    ----------
    residual : (n, m) float64
        Computed minus observed.
    covariance : (n, m, m) float64
        Of the observations, S.
    adjusted_covariance : (n, m, m) float64
        Of their adjusted values, J Q J'; NaN where not known.
    """
    if not len(residual):
        zero = np.zeros(residual.shape)
        return Reliability(zero, zero, zero, zero)
    weight = np.linalg.inv(covariance)
    Qvv = covariance - adjusted_covariance
    r = np.einsum("nij,nji->ni", Qvv, weight)
    q2 = np.einsum("nij,njk,nki->ni", weight, Qvv, weight)
    controlled = (r > UNCONTROLLED) & (q2 > 0)
    q = np.sqrt(np.where(controlled, q2, 1.0))
    w = np.einsum("nij,nj->ni", weight, residual) / q
    detectable = np.where(controlled, DELTA0 / q, np.nan)
    external = detectable * np.sqrt(np.maximum(np.einsum("nii->ni", weight) - q2, 0.0))
    return Reliability(r, np.where(controlled, w, np.nan), detectable, external)


def independent_reliability(residual: Float, whitener: Float, adjusted: Float) -> Reliability:
    """The same of records of independent components.

    Parameters
    ----------
    residual : (n, m) float64
    whitener : (n, m) float64
        Inverse standard deviations.
    adjusted : (n, m, m) float64
        Covariance of the whitened adjusted values; NaN where not known.
    """
    r = 1.0 - np.einsum("nii->ni", adjusted)
    controlled = (r > UNCONTROLLED) & (whitener > 0)
    root = np.sqrt(np.where(controlled, r, 1.0))
    over = np.where(controlled, 1.0 / root, np.nan)
    test = np.where(controlled, whitener * residual / root, np.nan)
    detectable = DELTA0 * over / np.where(controlled, whitener, 1.0)
    return Reliability(r, test, detectable, DELTA0 * over * np.sqrt(np.maximum(1.0 - r, 0.0)))


def moved(gain: Float, whitener: Float, detectable: Float, part: slice = slice(None)) -> Float:
    """How far a detectable error of each component moves a block of unknowns: the length of some of its scalars.

    Parameters
    ----------
    gain : (n, k, m) float64
        Of whitened observations, see `covariance.gains`.
    whitener : (n, m, m) or (n, m) float64
    detectable : (n, m) float64
    part : slice
        Scalars that make up the length: coordinates, or rotations.

    Returns
    -------
    (n, m) float64
        NaN where uncontrolled.
    """
    part_gain = gain[:, part]
    if whitener.ndim == 2:
        return np.asarray(np.sqrt(np.einsum("nkm,nkm->nm", part_gain, part_gain)) * whitener * detectable)
    per_unit = part_gain @ whitener
    return np.asarray(np.sqrt((per_unit**2).sum(axis=1)) * detectable)
