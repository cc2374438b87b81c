"""Strips tied by common points and by control, adjusted together: weights, gross errors, deformation.

Ground points are eliminated (orientation.tie_elimination). Strips are deformed: their points disagree by more than
their covariances C_o say. tau is what must be added, W_o = (C_o + tau^2 I)^-1; it is estimated such that sum v'W v of
the strips' points equals their redundancy, after a start from medians that gross errors do not disturb. tau is zero
where the strips agree as well as they should. Gross errors are found by data snooping (adjustment.snooping), and
observations rejected before, here or in an earlier stage, are re-admitted where they fit (orientation.tie_statistics).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.errors import ConvergenceError, GeometryError
from aatri.orientation.free_block.tie_elimination import (
    Eliminated,
    Linearised,
    Observations,
    eliminate,
    residual_cofactors,
    whitening,
)
from aatri.orientation.free_block.tie_statistics import clearest_errors, deformation, record_tests

S = TypeVar("S")

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
        size, test = record_tests(solved.system, cofactor, use)
        new_tau = deformation(o, solved.linear, solved.system, cofactor, use, robust)
        wrong = clearest_errors(test, o, solved.linear.covariance_m2, use, limit)
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
