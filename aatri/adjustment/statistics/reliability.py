"""Reliability of observations: redundancy numbers, test statistics, minimal detectable gross errors.

For a record with covariance S and residual cofactor Qvv = S - J Q J',

    r_i = (Qvv S^-1)_ii,    w_i = (S^-1 v)_i / q_i,    nabla_i = delta0 / q_i,    q_i = sqrt((S^-1 Qvv S^-1)_ii),

which for independent components is w = v / (sigma sqrt(r)), nabla = delta0 sigma / sqrt(r). A component with r below
`UNCONTROLLED` has neither test nor detectable error.

Source: Baarda 1968; Foerstner 1980.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Float

UNCONTROLLED = 1e-6
"""Redundancy numbers below this count as zero."""

DELTA0 = 4.13
"""Non-centrality of a test at the level 0.1 % with power 80 %."""


@dataclass(frozen=True)
class Reliability:
    """Reliability of n records of m components.

    Attributes
    ----------
    redundancy, test, detectable : (n, m) float64
        `detectable` in the unit of the observation; the last two NaN where uncontrolled.
    """

    redundancy: Float
    test: Float
    detectable: Float


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
        nothing = np.zeros(residual.shape)
        return Reliability(nothing, nothing, nothing)
    weight = np.linalg.inv(covariance)
    Qvv = covariance - adjusted_covariance
    r = np.einsum("nij,nji->ni", Qvv, weight)
    q2 = np.einsum("nij,njk,nki->ni", weight, Qvv, weight)
    known = (r > UNCONTROLLED) & (q2 > 0)
    q = np.sqrt(np.where(known, q2, 1.0))
    w = np.einsum("nij,nj->ni", weight, residual) / q
    return Reliability(np.clip(r, 0.0, 1.0), np.where(known, w, np.nan), np.where(known, DELTA0 / q, np.nan))
