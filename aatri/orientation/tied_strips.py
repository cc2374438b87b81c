"""Strips tied by common points and by control, adjusted together: weights, gross errors, deformation.

Ground points are eliminated (orientation.tie_elimination). Strips are deformed: their points disagree by more than
their covariances C_o say. tau is what must be added, W_o = (C_o + tau^2 I)^-1; it is estimated such that sum v'W v of
the strips' points equals their redundancy, after a start from medians that gross errors do not disturb. tau is zero
where the strips agree as well as they should. Gross errors are found by data snooping (adjustment.snooping), and
observations rejected before, here or in an earlier stage, are re-admitted where they fit.

Source: Paule & Mandel 1982 (added variance); Foerstner 1979 (variance components by redundancy); Baarda 1968.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
import numpy.typing as npt

from aatri.adjustment.snooping import UNCONTROLLED
from aatri.errors import ConvergenceError, GeometryError
from aatri.orientation.tie_elimination import (
    Eliminated,
    Linearised,
    Observations,
    eliminate,
    residual_cofactors,
    whitening,
)

Float = npt.NDArray[np.float64]
Int = npt.NDArray[np.int64]
Bool = npt.NDArray[np.bool_]
S = TypeVar("S")

MEDIAN_CHI2_3 = 2.366
"""Median of chi-square with three degrees of freedom."""

MAX_SHARE = 0.15
"""At most this share of a strip's ties, and of control, is rejected: where more disagrees the model is wrong, not the
data, and to go on rejecting would cut the strip off."""

ROUNDS = 25
MAX_ITERATIONS = 30
DECREMENT = 1e-4


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
    covariance : (n_blocks u, n_blocks u) float64
        A priori covariance of the unknowns; zero where not estimated.
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
    """What is adjusted.

    Attributes
    ----------
    observations : Observations
    linearise : callable
        state -> Linearised
    update : callable
        (state, step (n_blocks u,)) -> state
    what : str
        For messages.
    kept : (k,) int, optional
        The unknowns that are estimated; the others stay, their step is zero.
    """

    observations: Observations
    linearise: Callable[[S], Linearised]
    update: Callable[[S, Float], S]
    what: str
    kept: Int | None = None


@dataclass(frozen=True)
class _Solved(Generic[S]):
    state: S
    linear: Linearised
    system: Eliminated
    Q: Float
    unknowns: int
    iterations: int


def adjust_tied(problem: Problem[S], start: S, *, limit: float, active: Bool | None = None) -> TiedResult[S]:
    """Adjust all strips together, with data snooping and an estimate of the strips' deformation.

    Parameters
    ----------
    problem : Problem
    start : S
    limit : float
        Observations with a larger test statistic are rejected.
    active : (n,) bool, optional
        Observations to begin with; the others are tested for re-admission.

    Raises
    ------
    GeometryError
        If the unknowns are not determined.
    ConvergenceError
        If the iteration does not converge.
    """
    o = problem.observations
    use = np.ones(len(o.strip), dtype=bool) if active is None else active.copy()
    readmitted = np.zeros(len(use), dtype=bool)
    tau_m, robust, iterations = 0.0, True, 0
    solved = _solve(problem, start, use, tau_m)
    for _ in range(ROUNDS):
        iterations += solved.iterations
        cofactor = residual_cofactors(o, solved.system, solved.Q, use)
        size, test = _tests(solved.system, cofactor, use)
        new_tau = _deformation(o, solved, cofactor, use, robust)
        wrong = _worst(test, o, solved.linear.covariance_m2, use, limit)
        fitting = ~use & ~readmitted & (test < limit)
        if abs(new_tau - tau_m) > 0.02 * max(new_tau, tau_m):
            tau_m = new_tau
        elif wrong.any():
            use &= ~wrong
        elif robust and new_tau > 0:
            robust = False
            continue
        elif fitting.any():
            use |= fitting
            readmitted |= fitting
        else:
            break
        solved = _solve(problem, solved.state, use, tau_m)
    return _result(o, solved, use, size, test, tau_m, iterations)


def _solve(problem: Problem[S], state: S, use: Bool, tau_m: float) -> _Solved[S]:
    linear = problem.linearise(state)
    for iteration in range(1, MAX_ITERATIONS + 1):
        system = eliminate(problem.observations, linear, use, tau_m)
        kept = np.arange(len(system.N)) if problem.kept is None else problem.kept
        Q = np.zeros_like(system.N)
        Q[np.ix_(kept, kept)] = _inverse(system.N[np.ix_(kept, kept)], problem.what)
        step = Q @ system.g
        if np.sqrt(max(float(step @ system.g), 0.0)) <= DECREMENT:
            # Too small to count, but not to apply: what error-free data leave is rounding.
            state = problem.update(state, step)
            linear = problem.linearise(state)
            final = eliminate(problem.observations, linear, use, tau_m)
            return _Solved(state, linear, final, Q, len(kept), iteration)
        state = problem.update(state, step)
        linear = problem.linearise(state)
    raise ConvergenceError(
        f"{problem.what} did not converge in {MAX_ITERATIONS} iterations",
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


def _tests(system: Eliminated, cofactor: Float, use: Bool) -> tuple[Float, Float]:
    values, vectors = np.linalg.eigh(cofactor)
    controlled = values > UNCONTROLLED
    projected = np.einsum("nji,nj->ni", vectors, np.nan_to_num(system.v))
    scaled = np.where(controlled, projected / np.where(controlled, values, 1.0), 0.0)
    rows = np.where(np.isnan(system.v).any(1), 0, controlled.sum(1))
    test = np.where(rows > 0, np.sqrt((projected * scaled).sum(1) / np.maximum(rows, 1)), np.nan)
    size = np.where(use[:, None], -np.einsum("nij,nj->ni", vectors, scaled), -system.v)
    return size, test


def _worst(test: Float, o: Observations, covariance_m2: Float, use: Bool, limit: float) -> Bool:
    """The clearest gross errors: one per point, those at least half as large as the largest, few of each strip."""
    wrong = np.zeros(len(test), dtype=bool)
    candidates = np.flatnonzero(use & (test > limit))
    if not len(candidates):
        return wrong
    # Two observations of a point share one test: control is named before a strip, the less precise before the other.
    variance = np.einsum("nii->n", covariance_m2[candidates])
    order = candidates[np.lexsort((-variance, o.strip[candidates] >= 0, -np.round(test[candidates], 6)))]
    order = order[test[order] >= 0.5 * test[order[0]]]
    shared = np.bincount(o.point, minlength=o.n_points)[o.point] > 1
    source = o.strip + 1  # control, then the strips
    room = np.ceil(MAX_SHARE * np.bincount(source[shared], minlength=source.max() + 1)).astype(int)
    room -= np.bincount(source[~use & shared], minlength=len(room))
    # In a small problem one rejection changes the tests of all others: one at a time.
    most, points = max(1, len(test) // 100), set()
    for k in order:
        if len(points) < most and room[source[k]] > 0 and int(o.point[k]) not in points:
            wrong[k] = True
            room[source[k]] -= 1
            points.add(int(o.point[k]))
    return wrong


def _deformation(o: Observations, solved: _Solved[S], cofactor: Float, use: Bool, robust: bool) -> float:
    """The tau that makes the residuals of the strips' points as large as their redundancy says."""
    share = np.einsum("nii->n", cofactor) / 3
    rows = use & (o.strip >= 0) & (share > 0.02) & ~np.isnan(solved.system.v).any(1)
    values, vectors = np.linalg.eigh(solved.linear.covariance_m2[rows])
    if 3 * share[rows].sum() < 1 or values.max(initial=0.0) <= 0:
        return 0.0
    v = solved.system.point_m[o.point[rows]] - solved.linear.xyz_m[rows]
    squares = np.einsum("nji,nj->ni", vectors, v) ** 2
    values = np.maximum(values, 1e-12 * values.max())

    def excess(tau: float) -> float:
        q = (squares / (values + tau**2)).sum(1)
        if robust:
            return float(np.median(q / share[rows])) / MEDIAN_CHI2_3 - 1
        return float(q.sum() / (3 * share[rows].sum())) - 1

    if excess(0.0) <= 0:
        return 0.0
    low, high = 0.0, float(np.sqrt(values.max()))
    while excess(high) > 0:
        low, high = high, 4 * high
    for _ in range(30):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(middle) > 0 else (low, middle)
    return 0.5 * (low + high)


def _result(
    o: Observations, solved: _Solved[S], use: Bool, size: Float, test: Float, tau_m: float, iterations: int
) -> TiedResult[S]:
    system, linear = solved.system, solved.linear
    counted = use & ~np.isnan(system.v).any(1)
    counted &= np.bincount(o.point[counted], minlength=o.n_points)[o.point] > 1
    residual = np.where(o.given, system.point_m[o.point] - linear.xyz_m, np.nan)
    observations = int(o.given[counted].sum())
    unknowns = solved.unknowns + 3 * len(np.unique(o.point[counted]))
    apriori = np.einsum("nij,nj->ni", whitening(o, linear.covariance_m2, 0.0), np.nan_to_num(residual))[counted]
    redundancy = observations - unknowns
    return TiedResult(
        state=solved.state,
        point_m=system.point_m,
        point_covariance_m2=system.point_covariance_m2,
        residual_m=residual,
        covariance=solved.Q,
        active=use,
        size_m=np.where(o.given, np.einsum("nij,nj->ni", np.linalg.pinv(system.whitening), size), np.nan),
        test=test,
        tau_m=tau_m,
        observations=observations,
        unknowns=unknowns,
        sigma0=float(np.sqrt((apriori**2).sum() / redundancy)) if redundancy > 0 else float("nan"),
        iterations=iterations,
    )
