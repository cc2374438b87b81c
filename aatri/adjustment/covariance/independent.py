"""Number of independent errors that a set of correlated ones amounts to.

n normal errors with the covariance C have a mean square of expectation tr C / n and of variance 2 tr C^2 / n^2: as many
as

    (tr C)^2 / tr C^2

independent ones of equal size would have. tr C^2 is the sum of |C e|^2 over the unit vectors e, or of many errors the
mean of |C z|^2 over random vectors z of signs; C z is a solve with the factor, all vectors together. The mean of m
vectors is right to at most sqrt(2/m).

Source: Satterthwaite 1946 (effective degrees of freedom); Hutchinson 1989 (trace by random vectors).
"""

from collections.abc import Callable

import numpy as np

from aatri.adjustment.covariance.constrained import covariance_reduction, covariance_times
from aatri.adjustment.stepping.adjusted import Adjusted, factor_of
from aatri.arrays import Bool, Float, Int

MOST_UNIT_VECTORS = 64
"""Sets up to this size are taken unit vector by unit vector."""

VECTORS = 8
"""Random vectors for larger sets, each a solve: the count is right to at most 50 %, of n independent errors to about
50 % / sqrt(n / 2); limits of a ratio go with its root."""


def independent_errors(adjusted: Adjusted, group: str, members: Bool, variance: Float, others: Float) -> Float:
    """Independent errors among some blocks of a group, scalar by scalar.

    Parameters
    ----------
    adjusted : Adjusted
        Solved by its factor.
    members : (n, k) bool
        Which scalars of which blocks.
    variance : (n, k) float64
        Of the unknowns.
    others : (n, k) float64
        Variances of independent errors added to those of the unknowns: of what they are compared with.

    Returns
    -------
    (k,) float64
        NaN where a scalar has no members or no error.
    """
    times = _covariance_times(adjusted, group)
    total = variance + others

    def products(rows: Int, scalar: int, z: Float) -> Float:
        right = np.zeros((*members.shape, z.shape[1]))
        right[rows, scalar] = z
        return np.asarray(times(right)[rows, scalar] + others[rows, scalar, None] * z)

    def trace(rows: Int, scalar: int, _z: Float, _Cz: Float, _weight: float) -> float:
        return float(total[rows, scalar].sum())

    return _effective(members, products, trace)


def independent_predictions(adjusted: Adjusted, group: str, block: Int, J: Float, gain: Float) -> Float:
    """Independent errors among records predicted each without itself, component by component.

    A record l of unit covariance observes J of one block. Its residual v = J x - l has with all others the covariance
    I - J Q J'; predicted without itself it is off by d = G v, G the inverse of its own part of that.

    Parameters
    ----------
    adjusted : Adjusted
        Solved by its factor.
    block : (n,) int
        Block of each record, none twice.
    J : (n, m, k) float64
        Whitened.
    gain : (n, m, m) float64
        G to the unit asked for; zero rows for components without a prediction.

    Returns
    -------
    (m,) float64
        NaN where no record has the component.
    """
    times = _covariance_times(adjusted, group)
    size = next(u for u in adjusted.problem.unknowns if u.name == group).free.shape

    def products(rows: Int, component: int, z: Float) -> Float:
        y = gain[rows, component][:, :, None] * z[:, None, :]
        right = np.zeros((*size, z.shape[1]))
        right[block[rows]] = np.einsum("nmk,nmv->nkv", J[rows], y)
        Qy = np.einsum("nmk,nkv->nmv", J[rows], times(right)[block[rows]])
        return np.asarray(np.einsum("nm,nmv->nv", gain[rows, component], y - Qy))

    def trace(_rows: Int, _component: int, z: Float, Cz: Float, weight: float) -> float:
        return weight * float((z * Cz).sum())

    return _effective(np.asarray(gain.any(axis=2)), products, trace)


def _effective(
    members: Bool,
    products: Callable[[Int, int, Float], Float],
    trace: Callable[[Int, int, Float, Float, float], float],
) -> Float:
    """(tr C)^2 / tr C^2 of each set of members, (k,), from the products C z."""
    count = np.full(members.shape[1], np.nan)
    for k in range(members.shape[1]):
        rows = np.flatnonzero(members[:, k])
        if not len(rows):
            continue
        z, weight = _vectors(len(rows))
        Cz = products(rows, k, z)
        square = weight * float((Cz**2).sum())
        if square > 0:  # held scalars have no errors
            count[k] = trace(rows, k, z, Cz, weight) ** 2 / square
    return count


def _covariance_times(adjusted: Adjusted, group: str) -> Callable[[Float], Float]:
    """The product of the covariance of all blocks of a group with right-hand sides, (n, k, v) -> (n, k, v)."""
    problem, state = adjusted.problem, adjusted.state
    factored = factor_of(adjusted)
    W = covariance_reduction(problem, factored, state)
    return lambda right: covariance_times(problem, factored, state, W, {group: right})[group]


def _vectors(n: int) -> tuple[Float, float]:
    """Unit vectors, or random signs and the weight of each."""
    if n <= MOST_UNIT_VECTORS:
        return np.eye(n), 1.0
    return np.random.default_rng(0).choice([-1.0, 1.0], size=(n, VECTORS)), 1.0 / VECTORS
