"""Strips tied by common points and by control: least squares with the ground points eliminated.

A strip's point, transformed to the ground with the strip's unknowns t, and a control point are both observations of
the same unknown ground point X:

    v_o = X - x_o(t),   weight W_o = (C_o + tau^2 I)^-1,   control: x_o given, no unknowns.

With S = sum W_o over the observations o of the point, X = S^-1 sum W_o x_o, and with J = dx/dt what remains for t is

    B_o = J_o - S^-1 sum_p W_p J_p,   (sum B'W B) dt = sum B'W v.

For k strips of equal weight this is the factor (I - 11'/k): own block (k-1)/k, mutual block -1/k, any number of strips.
Cofactors of the residuals: Qvv = W_o^-1 - S^-1 - B_o Q B_o'; they give data snooping (see adjustment.snooping).

Strips are deformed: their points disagree by more than the covariances C_o of their points say. tau is what must be
added; it is estimated such that sum v'W v of the strips' points equals their redundancy, after a start from medians
that gross errors do not disturb (Paule & Mandel 1982; variance components after Foerstner 1979). tau is zero where the
strips agree as well as they should.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np
import numpy.typing as npt
from scipy import sparse

from aatri.adjustment.snooping import UNCONTROLLED
from aatri.errors import ConvergenceError, GeometryError

Float = npt.NDArray[np.float64]
Int = npt.NDArray[np.int64]
Bool = npt.NDArray[np.bool_]
S = TypeVar("S")

EXACT = 1e-2
"""Standard deviation of exact control, as a share of that of the strips' points: its residuals stay below 1e-4 of the
discrepancies, and its redundancy can still be told from rounding."""

MEDIAN_CHI2_3 = 2.366
ROUNDS = 25
CHUNK = 1000


@dataclass(frozen=True)
class Control:
    """Given ground coordinates.

    Attributes
    ----------
    point : (n,) int
        Number of the point.
    xyz_m : (n, 3) float64, m
    covariance_m2 : (n, 3, 3) float64, m^2
        Zero where exact.
    given : (n, 3) bool
        Coordinates that are control: all, plan only, height only.
    """

    point: Int
    xyz_m: Float
    covariance_m2: Float
    given: Bool


@dataclass(frozen=True)
class Observations:
    """Observations of ground points: first those of strips, then control.

    Attributes
    ----------
    strip : (n,) int
        Number of the strip; -1 for control.
    point : (n,) int
        Number of the point, 0 ... n_points - 1.
    n_points : int
    given : (n, 3) bool
        Coordinates observed; all of them in strips.
    """

    strip: Int
    point: Int
    n_points: int
    given: Bool


@dataclass(frozen=True)
class Linearised:
    """Observed ground coordinates in terms of the unknowns.

    Attributes
    ----------
    xyz_m : (n, 3) float64, m
    jacobian : (3 n, u) sparse
        Derivatives by the unknowns; zero for control.
    covariance_m2 : (n, 3, 3) float64, m^2
        A priori.
    """

    xyz_m: Float
    jacobian: sparse.csr_matrix
    covariance_m2: Float


@dataclass(frozen=True)
class Eliminated:
    """The problem with its points eliminated: whitened residuals and design, normal equations."""

    point_m: Float
    point_covariance: Float
    v: Float
    whitening: Float
    B: sparse.csr_matrix
    N: Float
    g: Float


@dataclass(frozen=True)
class TiedResult(Generic[S]):
    """Result of a tied adjustment.

    Attributes
    ----------
    state : S
    point_m : (n_points, 3) float64, m
        Adjusted ground points; NaN where no strip holds the point.
    point_covariance_m2 : (n_points, 3, 3) float64, m^2
        Of the adjusted points, the unknowns of the strips held; tau is in it.
    residual_m : (n, 3) float64, m
        Adjusted minus observed; NaN where not observed. For rejected observations that of a predicted value.
    covariance : (u, u) float64
        A priori covariance of the unknowns.
    active : (n,) bool
    size_m : (n, 3) float64, m
        Estimated gross error of each observation.
    test : (n,) float64
        Test statistic; NaN where it cannot be tested.
    tau_m : float, m
        What had to be added to the standard deviation of the strips' points.
    observations, unknowns : int
        Counts of coordinates, with the ground points as unknowns.
    sigma0 : float
        Ratio to the a priori standard deviations, tau not counted; NaN without redundancy.
    iterations : int
    """

    state: S
    point_m: Float
    point_covariance_m2: Float
    residual_m: Float
    covariance: Float
    active: Bool
    size_m: Float
    test: Float
    tau_m: float
    observations: int
    unknowns: int
    sigma0: float
    iterations: int


@dataclass(frozen=True)
class Problem(Generic[S]):
    """What is adjusted: observations, their linearisation, the update of the state; `what` is for messages."""

    observations: Observations
    linearise: Callable[[S], Linearised]
    update: Callable[[S, Float], S]
    what: str


def adjust_tied(
    problem: Problem[S],
    start: S,
    *,
    limit: float,
    active: Bool | None = None,
    max_share: float = 0.3,
) -> TiedResult[S]:
    """Adjust all strips together, with data snooping and an estimate of the strips' deformation.

    Parameters
    ----------
    problem : Problem
    start : S
    limit : float
        Observations with a larger test statistic are rejected.
    active : (n,) bool, optional
        Observations to begin with; the others are tested for re-admission.
    max_share : float
        At most this share of the observations is rejected.

    Raises
    ------
    GeometryError
        If the unknowns are not determined.
    ConvergenceError
        If the iteration does not converge.
    """
    n = len(problem.observations.strip)
    use = np.ones(n, dtype=bool) if active is None else active.copy()
    readmitted = np.zeros(n, dtype=bool)
    tau, robust, iterations = 0.0, True, 0
    state = start
    for _ in range(ROUNDS):
        state, system, Q, count = _solve(problem, state, use, tau)
        iterations += count
        cofactor = _cofactors(problem.observations, system, Q, use)
        size, test = _tests(system, cofactor, use)
        new_tau = _deformation(problem, state, system, cofactor, use, tau, robust)
        if abs(new_tau - tau) > 0.05 * max(new_tau, tau):
            tau = new_tau
            continue
        wrong = _worst(test, problem.observations, use, limit, max_share)
        fitting = ~use & ~readmitted & (test < limit)
        if wrong.any():
            use &= ~wrong
        elif robust:
            robust = False
        elif fitting.any():
            use |= fitting
            readmitted |= fitting
        else:
            break
    state, system, Q, count = _solve(problem, state, use, tau)
    cofactor = _cofactors(problem.observations, system, Q, use)
    size, test = _tests(system, cofactor, use)
    return _result(problem, state, system, Q, use, size, test, tau, iterations + count)


def eliminate(observations: Observations, linear: Linearised, use: Bool, tau_m: float) -> Eliminated:
    """Eliminate the ground points, see the module's text.

    Points without an active observation in a strip take no part: their control counts for nothing.
    """
    o = observations
    held = np.zeros(o.n_points, dtype=bool)
    held[o.point[use & (o.strip >= 0)]] = True
    T = whitening(o, linear.covariance_m2, tau_m)
    W = np.where((use & held[o.point])[:, None, None], T.swapaxes(1, 2) @ T, 0.0)
    total = np.zeros((o.n_points, 3, 3))
    np.add.at(total, o.point, W)
    total[~held] = np.eye(3)
    cov = np.linalg.inv(total)
    cov = 0.5 * (cov + cov.swapaxes(1, 2))
    # Reduced to the point's first observation, so that the mean keeps the digits of small discrepancies.
    base = np.zeros((o.n_points, 3))
    base[o.point[o.strip >= 0][::-1]] = linear.xyz_m[o.strip >= 0][::-1]
    pull = np.zeros((o.n_points, 3))
    np.add.at(pull, o.point, np.einsum("nij,nj->ni", W, linear.xyz_m - base[o.point]))
    xyz = base + np.einsum("nij,nj->ni", cov, pull)
    n = len(o.strip)
    blocks = np.arange(n), np.arange(n + 1)
    select = sparse.bsr_matrix((np.tile(np.eye(3), (n, 1, 1)), o.point, blocks[1]), shape=(3 * n, 3 * o.n_points))
    weighted = sparse.bsr_matrix((W, *blocks), shape=(3 * n, 3 * n)) @ linear.jacobian
    spread = sparse.bsr_matrix((cov, np.arange(o.n_points), np.arange(o.n_points + 1)))
    centred = linear.jacobian - select @ (spread @ (select.T @ weighted))
    B = sparse.csr_matrix(sparse.bsr_matrix((T, *blocks), shape=(3 * n, 3 * n)) @ centred)
    v = np.einsum("nij,nj->ni", T, xyz[o.point] - linear.xyz_m)
    counts = np.repeat((use & held[o.point]).astype(float), 3)
    Bw = sparse.diags(counts) @ B
    xyz = np.where(held[:, None], xyz, np.nan)
    v[~held[o.point]] = np.nan
    g = np.asarray(Bw.T @ np.where(counts > 0, np.nan_to_num(v.ravel()), 0.0))
    return Eliminated(xyz, np.where(held[:, None, None], cov, np.nan), v, T, B, (Bw.T @ Bw).toarray(), g)


def whitening(observations: Observations, covariance_m2: Float, tau_m: float) -> Float:
    """T with T'T = W, the weights; rows of coordinates that are not given are zero.

    Exact control gets `EXACT` times the standard deviation of the strips' points.
    """
    o = observations
    strips = o.strip >= 0
    added = np.full(len(o.strip), tau_m**2)
    variances = np.einsum("nii->n", covariance_m2[strips]) / 3 + tau_m**2
    model = float(np.median(variances)) if strips.any() else 0.0
    if model == 0.0:
        model = 1.0
        added[strips] = 1.0
    added[~strips] = 0.0
    C = covariance_m2 + added[:, None, None] * np.eye(3)
    exact = ~strips[:, None] & (np.einsum("nii->ni", C) < EXACT**2 * model)
    C = C + np.einsum("ni,ij->nij", np.where(exact, EXACT**2 * model, 0.0), np.eye(3))
    # Not given: a unit variance without covariances, cut away again below.
    both = o.given[:, :, None] & o.given[:, None, :]
    C = np.where(both, C, np.eye(3))
    T = np.linalg.inv(np.linalg.cholesky(C))
    return np.asarray(T * both)


def _solve(problem: Problem[S], state: S, use: Bool, tau_m: float) -> tuple[S, Eliminated, Float, int]:
    for iteration in range(1, 31):
        system = eliminate(problem.observations, problem.linearise(state), use, tau_m)
        Q = _inverse(system.N, problem.what)
        step = Q @ system.g
        state = problem.update(state, step)
        if np.sqrt(max(float(step @ system.g), 0.0)) <= 1e-4:
            system = eliminate(problem.observations, problem.linearise(state), use, tau_m)
            return state, system, Q, iteration
    raise ConvergenceError(
        f"{problem.what} did not converge in 30 iterations",
        remedy="look for wrong point numbers in the largest discrepancies",
    )


def _inverse(N: Float, what: str) -> Float:
    if not len(N):
        return N
    scale = np.sqrt(np.diag(N))
    if (scale == 0).any():
        raise GeometryError(f"{what}: {int((scale == 0).sum())} unknowns without any observation")
    try:
        L = np.linalg.cholesky(N / np.outer(scale, scale))
    except np.linalg.LinAlgError as error:
        raise GeometryError(f"{what}: the normal matrix of {len(N)} unknowns is singular") from error
    inverse = np.linalg.inv(L) / scale
    return np.asarray(inverse.T @ inverse)


def _cofactors(o: Observations, system: Eliminated, Q: Float, use: Bool) -> Float:
    T = system.whitening
    spread = T @ np.nan_to_num(system.point_covariance)[o.point] @ T.swapaxes(1, 2)
    for first in range(0, len(o.strip), CHUNK):
        B = system.B[3 * first : 3 * (first + CHUNK)].toarray().reshape(-1, 3, len(Q))
        spread[first : first + CHUNK] += (B @ Q) @ B.swapaxes(1, 2)
    given = o.given[:, :, None] * np.eye(3)
    return np.asarray(np.where(use[:, None, None], given - spread, given + spread))


def _tests(system: Eliminated, cofactor: Float, use: Bool) -> tuple[Float, Float]:
    values, vectors = np.linalg.eigh(cofactor)
    controlled = values > UNCONTROLLED
    projected = np.einsum("nji,nj->ni", vectors, np.nan_to_num(system.v))
    scaled = np.where(controlled, projected / np.where(controlled, values, 1.0), 0.0)
    rows = np.where(np.isnan(system.v).any(1), 0, controlled.sum(1))
    test = np.where(rows > 0, np.sqrt((projected * scaled).sum(1) / np.maximum(rows, 1)), np.nan)
    size = np.where(use[:, None], -np.einsum("nij,nj->ni", vectors, scaled), -system.v)
    return size, test


def _worst(test: Float, o: Observations, use: Bool, limit: float, max_share: float) -> Bool:
    """The clearest gross errors: one per point, and only those at least half as large as the largest."""
    wrong = np.zeros(len(test), dtype=bool)
    candidates = np.flatnonzero(use & (test > limit))
    # In a small problem one rejection changes the tests of all others: one at a time.
    room = min(int(max_share * len(test)) - int((~use).sum()), max(1, len(test) // 100))
    if not len(candidates) or room <= 0:
        return wrong
    # Two observations of a point share one test: control is named before a strip.
    order = candidates[np.lexsort((o.strip[candidates], -np.round(test[candidates], 6)))]
    order = order[test[order] >= 0.5 * test[order[0]]]
    _, first = np.unique(o.point[order], return_index=True)
    wrong[order[np.sort(first)][:room]] = True
    return wrong


def _deformation(
    problem: Problem[S], state: S, system: Eliminated, cofactor: Float, use: Bool, tau_m: float, robust: bool
) -> float:
    """The tau that makes the residuals of the strips' points as large as their redundancy says."""
    o = problem.observations
    share = np.einsum("nii->n", cofactor) / 3
    rows = use & (o.strip >= 0) & (share > 0.02) & ~np.isnan(system.v).any(1)
    if not rows.any() or share[rows].sum() * 3 < 1:
        return tau_m
    linear = problem.linearise(state)
    v = system.point_m[o.point[rows]] - linear.xyz_m[rows]
    values, vectors = np.linalg.eigh(linear.covariance_m2[rows])
    squares = np.einsum("nji,nj->ni", vectors, v) ** 2
    if values.max() <= 0:
        return 0.0

    def excess(tau: float) -> float:
        q = (squares / (np.maximum(values, 1e-12 * values.max()) + tau**2)).sum(1)
        if robust:
            return float(np.median(q / share[rows])) / MEDIAN_CHI2_3 - 1
        return float(q.sum() / (3 * share[rows].sum())) - 1

    if excess(0.0) <= 0:
        return 0.0
    low, high = 0.0, float(np.sqrt(values.max()))
    while excess(high) > 0:
        low, high = high, 4 * high
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(middle) > 0 else (low, middle)
    return 0.5 * (low + high)


def _result(
    problem: Problem[S],
    state: S,
    system: Eliminated,
    Q: Float,
    use: Bool,
    size: Float,
    test: Float,
    tau_m: float,
    iterations: int,
) -> TiedResult[S]:
    o = problem.observations
    linear = problem.linearise(state)
    counted = use & ~np.isnan(system.v).any(1)
    counted &= np.bincount(o.point[counted], minlength=o.n_points)[o.point] > 1
    residual = np.where(o.given, system.point_m[o.point] - linear.xyz_m, np.nan)
    observations = int(o.given[counted].sum())
    unknowns = len(Q) + 3 * len(np.unique(o.point[counted]))
    apriori = np.einsum("nij,nj->ni", whitening(o, linear.covariance_m2, 0.0), np.nan_to_num(residual))[counted]
    redundancy = observations - unknowns
    sigma0 = float(np.sqrt((apriori**2).sum() / redundancy)) if redundancy > 0 else float("nan")
    size_m = np.where(o.given, np.einsum("nij,nj->ni", np.linalg.pinv(system.whitening), size), np.nan)
    return TiedResult(
        state=state,
        point_m=system.point_m,
        point_covariance_m2=system.point_covariance,
        residual_m=residual,
        covariance=Q,
        active=use,
        size_m=size_m,
        test=test,
        tau_m=tau_m,
        observations=observations,
        unknowns=unknowns,
        sigma0=sigma0,
        iterations=iterations,
    )


def block_rows(J: Float, block: Int, n_blocks: int) -> sparse.csr_matrix:
    """Sparse design matrix of observations that each touch one block of unknowns.

    Parameters
    ----------
    J : (n, 3, u) float64
    block : (n,) int
        Block of each observation; -1 if it touches none.
    n_blocks : int

    Returns
    -------
    (3 n, u n_blocks) sparse
    """
    n, _, u = J.shape
    touching = np.repeat(block >= 0, 3)
    columns = np.repeat(u * block, 3)[touching, None] + np.arange(u)
    starts = np.concatenate([[0], np.cumsum(u * touching)])
    values = J.reshape(3 * n, u)[touching].ravel()
    return sparse.csr_matrix((values, columns.ravel(), starts), shape=(3 * n, u * n_blocks))


def observations_of(strip: Int, point: Int, n_points: int, control: Control | None = None) -> Observations:
    """Observations of strips' points, followed by control."""
    made = Observations(strip, point, n_points, np.ones((len(strip), 3), dtype=bool))
    if control is None:
        return made
    return replace(
        made,
        strip=np.concatenate([strip, np.full(len(control.point), -1)]),
        point=np.concatenate([point, control.point]),
        given=np.concatenate([made.given, control.given]),
    )
