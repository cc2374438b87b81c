"""Congruence of two epochs: which objects have moved, and by how much.

Coordinates x1 and x2 of the same points at two epochs, with covariances C1 and C2, differ by

    d = x2 - x1 = H t + B s + e,    e ~ N(0, C),    C = C1 + C2 - C12 - C21

with t the movement of one datum against the other (columns H; none where both epochs stand in the same datum) and s the
displacements of the points that have moved (B picks their coordinates). With

    P = C^-1 - C^-1 H (H'C^-1 H)^-1 H'C^-1

congruence of all points is tested by d'P d ~ chi2(n - rank H). If one point j alone has moved, the test gains

    T_j = v_j' P_jj^-1 v_j ~ chi2(k_j),    v = P d,    s_j = P_jj^-1 v_j,    C(s_j) = P_jj^-1.

The point with the largest T_j over its limit is taken out of the stable ones, and P becomes that of the rest,

    P <- P - P_.j P_jj^-1 P_j.

until none is beyond; then each of those taken out is asked again beside the other ones, and returns if it fits. A point
moved by delta is found with the probability of the noncentral distribution chi2(k_j, delta' P_jj delta), P that of the
other stable points; the smallest displacement found with 80 % in the direction that is determined worst is stated.
Each of m points is tested at 1 - (1 - level)^(1/m), so that a false alarm anywhere has the stated level. Where the
standard deviations are scaled by an estimated sigma0 with r degrees of freedom, F(k, r) takes the place of chi2(k) / k.

Sources: Pelzer 1971; Niemeier 1981; Caspary 1987, Concepts of network and deformation analysis, 5 and 6.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.special import chdtrc, chdtri, chndtrinc, fdtrc, fdtri, ncfdtrinc

from aatri.adjustment.statistics.limits import POWER
from aatri.arrays import Bool, Float, Int
from aatri.errors import GeometryError

DETERMINED = 1e-10
"""A displacement that the other points determine by less of its own weight is not tested: rounding takes 1e-12."""


@dataclass(frozen=True)
class Congruence:
    """Result of the comparison."""

    statistic: float
    degrees: int
    """Of the test of all objects together, chi2(degrees) without movement (times `sigma0` squared), int."""
    probability: float
    """Of a statistic as large by chance."""
    moved: Bool
    """(m,). Objects that are not congruent with the rest."""
    tested: Bool
    """(m,). False where the rest does not determine the object."""
    displacement: Float
    """(n,). Of each component if its object moved beside those found; NaN where not tested."""
    covariance: tuple[Float, ...]
    """Tuple of (k, k). Of the displacement of each object."""
    statistics: Float
    limits: Float
    probabilities: Float
    """(m,). Test of each object, its limit, and the probability of a test as large by chance."""
    detectable: Float
    """(m,). Displacement found with 80 % in the direction determined worst."""
    stable_statistic: float
    stable_degrees: int
    """Of the test of those that have not moved, int."""


def congruence(
    difference: Float,
    covariance: Float,
    object_of: Int,
    datum: Float | None = None,
    *,
    level: float = 0.05,
    sigma0: float = 1.0,
    sigma0_degrees: float = np.inf,
) -> Congruence:
    """Test two epochs for congruence, and find the objects that have moved.

    Parameters
    ----------
    difference : (n,) float64
        Second epoch minus first.
    covariance : (n, n) float64
        Of the differences; singular along `datum` at most.
    object_of : (n,) int
        Object of each component, 0 to m - 1, in any order.
    datum : (n, f) float64, optional
        Directions along which the datums may differ.
    level : float
        Probability of one false alarm or more.
    sigma0, sigma0_degrees : float
        Scale of the standard deviations, and the degrees of freedom it was estimated with; a priori without.

    Raises
    ------
    GeometryError
        If the covariance is singular beyond the datum, or the objects do not determine the datum.

    Examples
    --------
    Three heights, the last moved by ten standard deviations:

    >>> import numpy as np
    >>> result = congruence(np.array([0.1, -0.2, 10.0]), np.eye(3), np.arange(3), level=0.05)
    >>> result.moved.tolist(), round(float(result.displacement[2]), 3)
    ([False, False, True], 10.0)
    """
    m = int(object_of.max()) + 1 if len(object_of) else 0
    rows = [np.flatnonzero(object_of == k) for k in range(m)]
    H = np.zeros((len(difference), 0)) if datum is None else datum
    test = _Level(1.0 - (1.0 - level) ** (1.0 / max(m, 1)), sigma0, sigma0_degrees)
    P_all = _weights(covariance, H)
    moved: list[int] = []
    tested = np.ones(m, dtype=bool)
    while True:  # each round takes one object out, and a round of returns makes the end
        P = _without(P_all, rows, moved)
        statistics = np.full(m, -np.inf)
        for k in set(range(m)) - set(moved):
            tested[k] = _is_determined(P, covariance, rows[k])
            if tested[k]:
                statistics[k] = _gain(P, difference, rows[k]) / test.limit(len(rows[k]))
        worst = int(np.argmax(statistics)) if m else -1
        if m == 0 or statistics[worst] <= 1.0:
            break
        moved.append(worst)
    moved = _without_those_that_fit(P_all, rows, moved, difference, test)
    return _result(P_all, covariance, H, rows, moved, difference, test)


def explain_as_well(difference: Float, covariance: Float, object_of: Int, moved: Bool, *, level: float = 0.05) -> Bool:
    """Objects that explain the differences as well as one that has been named: which has moved cannot be told.

    With the other moved ones free, k instead of j has the likelihood exp(-(T_j - T_k) / 2) of j. Named are those with
    more than `level`: whatever k is, if it has moved alone, it is left out with a probability of `level` at most.

    Returns
    -------
    (m, m) bool
        Of each moved object, row by row, the others that may have moved instead of it.
    """
    m = len(moved)
    rows = [np.flatnonzero(object_of == k) for k in range(m)]
    P_all, as_well = _weights(covariance, np.zeros((len(difference), 0))), np.zeros((m, m), dtype=bool)
    for j in np.flatnonzero(moved).tolist():
        P = _without(P_all, rows, [k for k in np.flatnonzero(moved).tolist() if k != j])
        least = _gain(P, difference, rows[j]) + 2.0 * np.log(level)
        for k in np.flatnonzero(~moved).tolist():
            as_well[j, k] = _gain(P, difference, rows[k]) > least
    return as_well


@dataclass(frozen=True)
class _Level:
    """The test of one object at a level, with the scale of the standard deviations."""

    of_one: float
    sigma0: float
    degrees: float

    def limit(self, k: int) -> float:
        """Largest d'P d of k components that chance explains."""
        s2 = self.sigma0**2
        if np.isinf(self.degrees):
            return float(s2 * chdtri(k, self.of_one))
        return float(s2 * k * fdtri(k, self.degrees, 1.0 - self.of_one))

    def probability(self, statistic: float, k: int) -> float:
        """Of a statistic as large by chance."""
        if k == 0:
            return 1.0
        t = statistic / self.sigma0**2
        return float(chdtrc(k, t) if np.isinf(self.degrees) else fdtrc(k, self.degrees, t / k))

    def noncentrality(self, k: int) -> float:
        """delta'P delta of a displacement that is found with 80 %."""
        limit = self.limit(k) / self.sigma0**2
        if np.isinf(self.degrees):
            return float(self.sigma0**2 * chndtrinc(limit, k, 1.0 - POWER))
        return float(self.sigma0**2 * ncfdtrinc(k, self.degrees, 1.0 - POWER, limit / k))


def _weights(C: Float, H: Float) -> Float:
    """P of all objects. What H carries does not count, so that C may be made regular along it."""
    regular = C + (H * (np.trace(C) / max(np.einsum("ni,ni->", H, H), 1e-300))) @ H.T
    scale = np.sqrt(np.maximum(np.diag(regular), 0.0))
    try:
        if not (scale > 0).all():
            raise np.linalg.LinAlgError
        factor = cho_factor(regular / np.outer(scale, scale), lower=True)
    except np.linalg.LinAlgError:
        raise GeometryError(
            "the covariance of the differences is singular beyond the movement of the datum",
            remedy="leave out exact coordinates, and choose `datum: similarity` for epochs with a free datum",
        ) from None
    inverse = cho_solve(factor, np.eye(len(C))) / np.outer(scale, scale)
    if not H.shape[1]:
        return np.asarray(inverse)
    U = inverse @ H
    try:
        return np.asarray(inverse - U @ np.linalg.solve(H.T @ U, U.T))
    except np.linalg.LinAlgError:
        raise GeometryError(
            f"{len(C)} coordinates do not determine the movement of the datum",
            remedy="compare more points, not all in one line, or allow the datum less",
        ) from None


def _without(P: Float, rows: Sequence[Int], out: list[int]) -> Float:
    """P with some objects free to move."""
    if not out:
        return P
    J = np.concatenate([rows[k] for k in out])
    return np.asarray(P - P[:, J] @ np.linalg.solve(P[np.ix_(J, J)], P[J]))


def _is_determined(P: Float, C: Float, J: Int) -> bool:
    """Whether the stable objects say where this one must be, in all its components, beside its own weight."""
    sigma = np.sqrt(np.diag(C)[J])
    return bool(np.linalg.eigvalsh(P[np.ix_(J, J)] * np.outer(sigma, sigma))[0] > DETERMINED)


def _gain(P: Float, d: Float, J: Int) -> float:
    v = P[J] @ d
    return float(v @ np.linalg.solve(P[np.ix_(J, J)], v))


def _without_those_that_fit(P_all: Float, rows: Sequence[Int], moved: list[int], d: Float, test: _Level) -> list[int]:
    """Of the objects taken out, those that do not fit beside the other ones; the best fit returns first."""
    moved = list(moved)
    while moved:
        shares = []
        for k in moved:
            P = _without(P_all, rows, [other for other in moved if other != k])
            shares.append(_gain(P, d, rows[k]) / test.limit(len(rows[k])))
        best = int(np.argmin(shares))
        if shares[best] > 1.0:
            break
        del moved[best]
    return moved


def _result(
    P_all: Float, C: Float, H: Float, rows: Sequence[Int], moved: list[int], d: Float, test: _Level
) -> Congruence:
    m, f = len(rows), H.shape[1]
    stable = _without(P_all, rows, moved)
    displacement, covariances = np.full(len(d), np.nan), []
    statistics, limits, detectable = np.full(m, np.nan), np.full(m, np.nan), np.full(m, np.nan)
    tested = np.zeros(m, dtype=bool)
    for k, J in enumerate(rows):
        P = _without(P_all, rows, [other for other in moved if other != k]) if k in moved else stable
        tested[k] = _is_determined(P, C, J)
        limits[k] = test.limit(len(J))
        if not tested[k]:
            covariances.append(np.full((len(J), len(J)), np.nan))
            continue
        own = np.linalg.inv(P[np.ix_(J, J)])
        displacement[J], statistics[k] = own @ (P[J] @ d), _gain(P, d, J)
        covariances.append(own)
        detectable[k] = np.sqrt(test.noncentrality(len(J)) * np.linalg.eigvalsh(own)[-1])
    free = sum(len(rows[k]) for k in moved)
    statistic, degrees = float(d @ P_all @ d), len(d) - f
    of_stable, stable_degrees = float(d @ stable @ d), len(d) - f - free
    is_moved = np.isin(np.arange(m), moved)
    return Congruence(
        statistic,
        degrees,
        test.probability(statistic, degrees),
        is_moved,
        tested,
        displacement,
        tuple(covariances),
        statistics,
        limits,
        np.array([test.probability(t, len(J)) if ok else np.nan for t, J, ok in zip(statistics, rows, tested)]),
        detectable,
        of_stable,
        stable_degrees,
    )
