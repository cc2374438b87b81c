"""Variance components: the standard deviation that a group of observations turns out to have.

A group of records with known covariances C_o has, beyond them, a common standard deviation tau in every component:
S_o = C_o + tau^2 I. Asked is the tau for which the sum of squared standardised residuals equals the sum of redundancy
numbers,

    sum_o v_o'(C_o + tau^2 I)^-1 v_o = sum_o r_o,

which falls with tau; its robust form asks it of the median. tau is zero where the residuals are small enough without.
With the eigenvalues l and eigenvectors of C_o, squares q of the residuals along them, each term is q / (l + tau^2).
With C_o = 0, whitened residuals and their squares, tau is the factor on the standard deviations of the group,

    tau^2 = v'P v / r,     r = sum of its redundancy numbers,

known with a relative standard deviation of sqrt(2 / r): its square lies between tau^2 r / chi2(r; 0.975) and tau^2 r /
chi2(r; 0.025). Repeated with the new weights until all factors are 1 it is Foerstner's form of Helmert's estimate: the
same solution as by Helmert's matrix, or by maximum likelihood of the residuals (REML), reached in more and cheaper
steps. A group with a redundancy below `ESTIMABLE_REDUNDANCY` keeps its standard deviation: 95 % of such estimates lie
anywhere between 0.57 and 1.43 and worse.

Source: Helmert 1907; Foerstner 1979 (variance components by redundancy); Paule & Mandel 1982 (added variance).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import chdtri, gammaincinv

from aatri.adjustment.statistics.limits import ESTIMABLE_REDUNDANCY, SILENT_REDUNDANCY
from aatri.adjustment.threads import in_threads
from aatri.arrays import Bool, Float, Int

CHUNK = 1 << 15
"""Records at a time, whose terms stay in the cache."""


def common_sigma(squares: Float, known_variance: Float, share: Float, *, robust: bool = False) -> float:
    """The standard deviation that records of m components have beyond what is known.

    Parameters
    ----------
    squares : (n, m) float64
        Squared residuals along the eigenvectors of each known covariance, unit squared.
    known_variance : (n, m) float64
        Eigenvalues of the known covariances, unit squared; all zero where there are none.
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
    usable = np.isfinite(squares @ np.ones(m)) & np.isfinite(share)
    if not known_variance.any() and not robust:
        total = m * float(share[usable].sum())
        return float(np.sqrt(max(float(squares[usable].sum()), 0.0) / total)) if total > 0 else 0.0
    usable &= share > SILENT_REDUNDANCY
    q, values = (np.stack([column[usable] for column in of_rows.T]) for of_rows in (squares, known_variance))
    share = share[usable]
    sums, half = np.empty_like(share), len(share) // 2
    largest, total = float(values.max(initial=0.0)), m * float(share.sum())
    middle = 2 * float(gammaincinv(m / 2, 0.5)) * share  # the median of chi squared
    if largest <= 0:
        return float(np.sqrt(np.median(np.add.reduce(q) / middle))) if len(share) else 0.0
    if total < 1:
        return 0.0
    np.maximum(values, 1e-12 * largest, out=values)

    def excess(tau: float) -> float:
        def part(first: int, last: int) -> None:
            for chunk in (slice(a, min(a + CHUNK, last)) for a in range(first, last, CHUNK)):
                np.add.reduce(q[:, chunk] / (values[:, chunk] + tau**2), out=sums[chunk])
                if robust:
                    sums[chunk] /= middle[chunk]

        in_threads(len(sums), part)
        if robust:
            sums.partition([half - 1, half] if len(sums) % 2 == 0 else half)
            return float((sums[half] if len(sums) % 2 else 0.5 * (sums[half - 1] + sums[half])) - 1)
        return float(sums.sum() / total - 1)

    if excess(0.0) <= 0:
        return 0.0
    from scipy.optimize import brentq  # takes a tenth of a second to import

    low, high = 0.0, float(np.sqrt(largest))
    while excess(high) > 0:
        low, high = high, 4 * high
    # `excess` goes as an argument: brentq leaves its function in a cycle, which would keep these arrays for long.
    return float(brentq(lambda tau, of_tau: of_tau(tau), low, high, args=(excess,), rtol=1e-9))


@dataclass(frozen=True)
class GroupSigmas:
    """Factors on the standard deviations of groups of observations, from one adjustment."""

    count: Int
    """(g,). Components observed."""
    redundancy: Float
    """(g,)."""
    factor: Float
    """(g,). On the standard deviations in use; 1 where not estimable."""
    estimable: Bool
    """(g,)."""

    @cached_property
    def limits(self) -> tuple[Float, Float]:
        """95 % limits of the true factors, chi-square with r degrees of freedom; NaN where not estimable."""
        r = np.where(self.estimable, self.redundancy, np.nan)
        return self.factor * np.sqrt(r / chdtri(r, 0.025)), self.factor * np.sqrt(r / chdtri(r, 0.975))

    @property
    def differs(self) -> Bool:
        """Groups whose standard deviation in use is outside the limits."""
        low, high = self.limits
        return np.asarray(self.estimable & ((low > 1) | (high < 1)))


def group_sigmas(squares: Float, redundancy: Float, group: Int, n_groups: int) -> GroupSigmas:
    """Factors of all groups.

    Parameters
    ----------
    squares : (n,) float64
        v_i (P v)_i of every component.
    redundancy : (n,) float64
        (Qvv P)_ii.
    group : (n,) int
        -1: none.
    """
    usable = (group >= 0) & np.isfinite(squares) & np.isfinite(redundancy)
    squares, redundancy, group = squares[usable], redundancy[usable], group[usable]
    count = np.bincount(group, minlength=n_groups)
    r = np.asarray(np.bincount(group, redundancy, minlength=n_groups), dtype=np.float64)
    estimable = np.asarray(r >= ESTIMABLE_REDUNDANCY)
    squares_of_group = np.bincount(group, squares, minlength=n_groups)
    factor = np.sqrt(np.divide(np.maximum(squares_of_group, 0.0), r, out=np.ones(n_groups), where=estimable))
    return GroupSigmas(count, r, factor, estimable)
