"""Variance components: what must be added to a-priori covariances so that residuals are as large as they should be.

A group of records with covariances C_o has, beyond them, a common standard deviation tau in every component:
S_o = C_o + tau^2 I. Asked is the tau for which the sum of squared standardised residuals equals the sum of redundancy
numbers,

    sum_o v_o'(C_o + tau^2 I)^-1 v_o = sum_o r_o,

which falls with tau; its robust form asks it of the median. tau is zero where the residuals are small enough without.
With the eigenvalues l and eigenvectors of C_o, squares q of the residuals along them, each term is q / (l + tau^2).

Source: Paule & Mandel 1982 (added variance); Foerstner 1979 (variance components by redundancy).
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq
from scipy.stats import chi2

from aatri.arrays import Float

LEAST_SHARE = 0.02
"""Records with a smaller mean redundancy number say nothing of their own variance."""


def added_sigma(squares: Float, eigenvalues: Float, share: Float, *, robust: bool) -> float:
    """The standard deviation that records of m components need beyond their covariances.

    Parameters
    ----------
    squares : (n, m) float64
        Squared residuals along the eigenvectors of each covariance, unit squared.
    eigenvalues : (n, m) float64
        Of the covariances, unit squared.
    share : (n,) float64
        Mean redundancy number of each record.
    robust : bool
        Ask it of the median, which gross errors hardly disturb.

    Returns
    -------
    float
        In the unit of the residuals.
    """
    m = squares.shape[1]
    # Component by component: sums along three numbers of a row cost more than all the rest.
    rows = np.flatnonzero((share > LEAST_SHARE) & np.isfinite(squares @ np.ones(m)))
    q, values, share = squares[rows].T.copy(), eigenvalues[rows].T.copy(), share[rows]
    largest, total = float(values.max(initial=0.0)), m * float(share.sum())
    if total < 1 or largest <= 0:
        return 0.0
    np.maximum(values, 1e-12 * largest, out=values)
    middle = float(chi2.median(m)) * share

    def excess(tau: float) -> float:
        terms = q / (values + tau**2)
        if robust:
            return float(np.median(np.add.reduce(terms) / middle) - 1)
        return float(terms.sum() / total - 1)

    if excess(0.0) <= 0:
        return 0.0
    low, high = 0.0, float(np.sqrt(largest))
    while excess(high) > 0:
        low, high = high, 4 * high
    return float(brentq(excess, low, high, rtol=1e-9))
