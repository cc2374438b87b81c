"""Significance, determinability and correlation of a group of parameters.

Of estimates p with covariance C, prior values of zero with weights P0 = diag(1/sigma_prior^2):

    data share    r_i = 1 - C_ii / sigma_prior_i^2       redundancy of the pseudo-observation: 1 data, 0 prior
    t test        t_i = p_i / (s0 sqrt(V_ii)),           V = C - C P0 C, covariance of p if all true values are zero
    joint test    F = p' V^+ p / (rank V  s0^2)
    correlation   rho_ij = C_ij / sqrt(C_ii C_jj)
    total         rho_i^2 = 1 - 1 / (C_ii (C^-1)_ii)     of one parameter with all others

Without prior V = C and r = 1. t is compared with Student's distribution of `redundancy` degrees of freedom, F with
Fisher's; with sigma0 known these are the normal and the chi-square distribution.

Source: Gruen 1980, Precision and reliability aspects in close-range photogrammetry; Koch, Parameter Estimation, ch. 4.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import chdtrc, fdtrc, ndtr, stdtr  # scipy.stats takes a second to import

from aatri.adjustment.statistics.limits import UNDETERMINED_SHARE
from aatri.arrays import Bool, Float


@dataclass(frozen=True)
class Estimates:
    """Estimates of one group of parameters."""

    names: tuple[str, ...]
    values: Float
    """(s,)."""
    covariance: Float
    """(s, s). A priori, without sigma0; NaN where a parameter is not determined."""
    prior_sigma: Float
    """(s,). Of the pseudo-observation of zero; infinite without."""
    sigma0: float = 1.0
    """Factor of the standard deviations: 1 a priori."""
    redundancy: float = np.inf
    """Degrees of freedom of sigma0; infinite if it is known."""


@dataclass(frozen=True)
class ParameterTests:
    """Tests of single parameters, one row each."""

    sigma: Float
    """(s,). Standard deviation, sigma0 applied."""
    data_share: Float
    """(s,). Share of the value that comes from the data; NaN undetermined."""
    t: Float
    """(s,). Test statistic; NaN where the data share is below `UNDETERMINED_SHARE`."""
    p_value: Float
    """(s,). Probability of a larger |t| if the true value is zero."""
    significant: Bool
    """(s,)."""


@dataclass(frozen=True)
class JointTest:
    """Test of several parameters together."""

    statistic: float
    parameters: int
    p_value: float


class CorrelatedPair(NamedTuple):
    """Two parameters with a high correlation."""

    first: str
    second: str
    correlation: float


def estimates(
    names: Sequence[str],
    values: Float,
    covariance: Float,
    prior_sigma: Float | None = None,
    *,
    sigma0: float = 1.0,
    redundancy: float = np.inf,
) -> Estimates:
    """Estimates with checked shapes; without `prior_sigma` no parameter has a prior."""
    n = len(names)
    prior = np.full(n, np.inf) if prior_sigma is None else np.asarray(prior_sigma, dtype=np.float64)
    if values.shape != (n,) or covariance.shape != (n, n) or prior.shape != (n,):
        raise ValueError(f"{n} names, values {values.shape}, covariance {covariance.shape}, priors {prior.shape}")
    return Estimates(tuple(names), values, covariance, prior, sigma0, redundancy)


def parameter_tests(e: Estimates, alpha: float = 0.05) -> ParameterTests:
    """Test every parameter by itself.

    Parameters
    ----------
    alpha : float
        Level of significance, two-sided.
    """
    variance = np.diag(e.covariance)
    determined = np.isfinite(variance) & (variance > 0)
    share = np.where(determined, 1.0 - np.where(determined, variance, 0.0) / e.prior_sigma**2, np.nan)
    spread = np.diag(_spread_under_zero(e))
    testable = determined & (share >= UNDETERMINED_SHARE)
    scale = e.sigma0 * np.sqrt(np.where(testable, spread, 1.0))
    t = np.where(testable, e.values / scale, np.nan)
    size = np.abs(np.where(testable, t, 0.0))
    beyond = ndtr(-size) if np.isinf(e.redundancy) else stdtr(e.redundancy, -size)
    p_value = np.where(testable, 2 * beyond, np.nan)
    sigma = np.where(determined, e.sigma0 * np.sqrt(np.where(determined, variance, 0.0)), np.nan)
    return ParameterTests(sigma, share, t, p_value, testable & (np.where(testable, p_value, 1.0) <= alpha))


def joint_test(e: Estimates) -> JointTest:
    """Test parameters together: is any of them different from zero?"""
    rows = np.flatnonzero(np.isfinite(np.diag(e.covariance)))
    spread = _spread_under_zero(e)[np.ix_(rows, rows)]
    scale = np.sqrt(np.maximum(np.diag(spread), np.finfo(float).tiny))
    eigenvalues, vectors = np.linalg.eigh(spread / np.outer(scale, scale))
    used = eigenvalues > 1e-10
    rank = int(used.sum())
    if rank == 0:
        return JointTest(np.nan, 0, np.nan)
    standard = (vectors.T @ (e.values[rows] / scale))[used] / np.sqrt(eigenvalues[used])
    statistic = float(standard @ standard) / rank / e.sigma0**2
    if np.isinf(e.redundancy):
        return JointTest(statistic, rank, float(chdtrc(rank, statistic * rank)))
    return JointTest(statistic, rank, float(fdtrc(rank, e.redundancy, statistic)))


def correlations(e: Estimates) -> Float:
    """Correlation matrix, (s, s); NaN where a parameter is not determined."""
    sigma = _sigma(np.diag(e.covariance))
    return np.asarray(e.covariance / np.outer(sigma, sigma))


def correlated_pairs(e: Estimates, limit: float) -> list[CorrelatedPair]:
    """Pairs of parameters with |correlation| of at least the limit, the highest first."""
    rho = np.triu(correlations(e), 1)
    return _pairs(rho, e.names, e.names, limit)


def correlated_with_others(
    e: Estimates, cross_covariance: Float, other_variance: Float, other_names: Sequence[str], limit: float
) -> list[CorrelatedPair]:
    """Pairs of a parameter and an unknown outside the group, as the principal distance and a Z0.

    Parameters
    ----------
    cross_covariance : (s, k) float64
    other_variance : (k,) float64
    """
    rho = cross_covariance / np.outer(_sigma(np.diag(e.covariance)), _sigma(other_variance))
    return _pairs(rho, e.names, other_names, limit)


def _spread_under_zero(e: Estimates) -> Float:
    """V = C - C P0 C; rows of undetermined parameters stay NaN."""
    determined = np.isfinite(np.diag(e.covariance))
    C = np.where(np.outer(determined, determined), e.covariance, 0.0)
    spread = C - (C / e.prior_sigma**2) @ C
    return np.where(np.outer(determined, determined), spread, np.nan)


def _sigma(variance: Float) -> Float:
    return np.asarray(np.sqrt(np.where(variance > 0, variance, np.nan)))


def _pairs(rho: Float, first: Sequence[str], second: Sequence[str], limit: float) -> list[CorrelatedPair]:
    size = np.where(np.isfinite(rho), np.abs(rho), 0.0)
    rows, columns = np.nonzero(size >= limit)
    order = np.argsort(-size[rows, columns], kind="stable")
    return [CorrelatedPair(first[i], second[j], float(rho[i, j])) for i, j in zip(rows[order], columns[order])]
