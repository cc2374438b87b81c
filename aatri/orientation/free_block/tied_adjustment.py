"""Strips tied by common points and by given coordinates, adjusted together: weights, gross errors, deformation.

Strips are deformed: their points disagree by more than their covariances C_o say. tau is what must be added, W_o = (C_o
+ tau^2 I)^-1 (adjustment.statistics.variance_components); it is zero where the strips agree as well as they should.
Gross errors are found by data snooping, and observations rejected before, here or in an earlier stage, are re-admitted
where they fit (adjustment.statistics.search).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np

from aatri.adjustment.statistics.rejection import Pool, Snooping, pool_of, room_left
from aatri.adjustment.statistics.room import room_of
from aatri.adjustment.statistics.search import Searched, clearest_controlled, search
from aatri.arrays import Bool, Float, Int
from aatri.orientation.free_block.tie_records import (
    POINT,
    STRIP,
    Given,
    Ties,
    tie_whitener,
    typical_variance,
)
from aatri.orientation.free_block.tied_solution import (
    TiedProblem,
    TiedSolution,
    in_three,
    solve_tied,
    tied_problem,
)
from aatri.orientation.free_block.uncontrolled_ties import uncontrolled_observations
from aatri.orientation.free_block.weighted_means import weighted_means

S = TypeVar("S")

SIMILARITY = 7
"""Coordinates that bring a body to the ground."""


@dataclass(frozen=True)
class TiedResult(Generic[S]):
    """Result of a tied adjustment; observations are the ties, then the given coordinates, kind after kind.

    Attributes
    ----------
    state : S
        Unknowns of the strips.
    sigma : (n_strips, k) float64
        Their a priori standard deviations; zero where held.
    point_m : (n_points, 3) float64, m
        Adjusted ground points; NaN where no strip holds the point.
    mean_m, mean_covariance_m2 : (n_points, 3), (n_points, 3, 3) float64, m, m^2
        Weighted means over the strips, given coordinates not counted, and their covariances with the unknowns of the
        strips held; tau is in them.
    residual_m : (n, 3) float64, m
        Adjusted minus observed; NaN where not observed. For rejected observations that of a predicted value.
    active : (n,) bool
    size_m : (n, 3) float64, m
        Estimated gross error of each observation.
    test : (n,) float64
        Test statistic; NaN where it cannot be tested.
    above : (n,) bool
        Used, though the test is above the limit: too many of the same strip or kind are rejected already.
    tau_m : float, m
        What had to be added to the standard deviation of the strips' points.
    observations, unknowns : int
        Counts of coordinates, with the ground points as unknowns.
    sigma0 : float
        Ratio to the a priori standard deviations, tau not counted; NaN without redundancy.
    weighted_sigma0 : float
        The same with tau counted: near 1 where tau had to be added.
    given_sigma0, given_redundancy : float
        That of the given coordinates alone, and the sum of their redundancy numbers.
    iterations : int
    settled : bool
        False if the search for gross errors was broken off.
    uncontrolled : (k,) int64, (k,) float64, (k, 3) float64
        Active observations that others at their point should control, and do not: rows, redundancy number, direction.
    point_covariance_m2 : (n_points, 3, 3) float64, m^2, or None
        Of the adjusted ground points, where asked for; NaN where no strip holds the point.
    """

    state: S
    sigma: Float
    point_m: Float
    mean_m: Float
    mean_covariance_m2: Float
    residual_m: Float
    active: Bool
    size_m: Float
    test: Float
    above: Bool
    tau_m: float
    observations: int
    unknowns: int
    sigma0: float
    weighted_sigma0: float
    given_sigma0: float
    given_redundancy: float
    iterations: int
    settled: bool
    uncontrolled: tuple[Int, Float, Float]
    point_covariance_m2: Float | None = None


def adjust_tied(
    ties: Ties[S], given: Sequence[Given], start: S, rule: Snooping, *, what: str, active: Bool | None = None,
    points: bool = False, deformed: bool = True,
) -> TiedResult[S]:  # fmt: skip
    """Adjust all strips together, with data snooping and an estimate of the strips' deformation.

    Parameters
    ----------
    ties : Ties
    given : sequence of Given
    start : S
        Unknowns of the strips.
    rule : Snooping
    what : str
        For messages.
    active : (n,) bool, optional
        Observations to begin with; the others are tested for re-admission.
    points : bool
        With the covariances of the adjusted ground points.
    deformed : bool
        Estimate the strips' deformation; else there is none.

    Raises
    ------
    GeometryError
        If the unknowns are not determined.
    ConvergenceError
        If the iteration does not converge.
    """
    return adjust_indexed(tied_problem(ties, given, start, what), start, rule, active=active, points=points,
                          deformed=deformed)  # fmt: skip


def adjust_indexed(
    problem: TiedProblem[S], start: S, rule: Snooping, *, active: Bool | None = None, points: bool = False,
    deformed: bool = True,
) -> TiedResult[S]:  # fmt: skip
    """The same of a problem whose index is made."""
    values, _ = problem.ties.spectrum(start)
    variances = [values.sum(axis=1), *(g.variance for g in problem.given)]
    n = sum(len(v) for v in variances)
    pool = pool_of(rule, problem.records, variances)

    def solve(before: TiedSolution[S] | None, use: Bool, tau_m: float) -> TiedSolution[S]:
        return solve_tied(problem, start if before is None else before.state, use, tau_m, before)

    begin = np.ones(n, dtype=bool) if active is None else active
    found = _searched(solve, begin, rule, pool, deformed)
    return _result(problem, found, points)


def _searched(
    solve: Callable[[TiedSolution[S] | None, Bool, float], TiedSolution[S]], begin: Bool, rule: Snooping, pool: Pool,
    deformed: bool,
) -> Searched[TiedSolution[S]]:  # fmt: skip
    """Search; where more of what is given of a kind contradicts the rest than there is room for, all of it is kept."""
    room: list[Int] = []

    def wrong(solved: TiedSolution[S], use: Bool) -> Bool:
        if not room:
            room.append(_room(solved, rule, pool))
        return clearest_controlled(rule, replace(pool, room=room[0]), solved, use)

    found = search(solve, begin, rule, pool, wrong, added=deformed)
    full = replace(pool, room=room[0]) if room else pool
    crowded = np.unique(pool.source[found.above & ~pool.carrier])
    crowded = crowded[room_left(rule, full, found.active)[crowded] <= 0] if room else crowded[:0]
    rejected = np.isin(pool.source, crowded) & begin & ~found.active
    if not rejected.any():
        return found
    room[0][crowded] = 0
    return search(solve, begin, rule, pool, wrong, added=deformed)


def _room(solved: TiedSolution[S], rule: Snooping, pool: Pool) -> Int:
    """How many may be rejected: of a strip the share of the rule; of what is given also what the others answer for."""
    none = np.ones(len(pool.source), dtype=bool)
    room, sources = room_left(rule, pool, none), int(pool.source.max()) + 1
    weights = np.where(pool.counted, solved.answered, 0.0)
    answered: Float = np.bincount(pool.source, weights, sources).astype(np.float64)
    # Whatever goes, seven coordinates and one to test them are left of all that is given.
    spare = max(sum(int(g.given.sum()) for g in solved.problem.given) - SIMILARITY - 1, 0) // 3
    return np.maximum(room, np.minimum(room_of(answered, np.bincount(pool.source, minlength=sources)), spare))


def _result(problem: TiedProblem[S], found: Searched[TiedSolution[S]], points: bool) -> TiedResult[S]:
    solved, ties, use = found.solved, problem.ties, found.active
    n = len(ties.strip)
    observed = np.concatenate([np.ones((n, 3), dtype=bool), *(g.given for g in problem.given)])
    xyz = ties.on_ground(solved.state, ties.rows) - problem.base_m[ties.point]
    mean, covariance = weighted_means(ties, xyz, solved.whiteners[0], use[:n])
    reduced = np.where(np.isfinite(mean), solved.solved.state[POINT], np.nan)
    used = use & solved.held
    counted, points_counted = _counted(problem, used)
    prior = 0 if ties.prior is None else ties.prior.whitener.shape[0] * ties.prior.whitener.shape[1]
    observations = int(observed[counted].sum()) + prior
    of_prior = 0.0
    if ties.prior is not None:
        of_prior = float((ties.prior.evaluate(solved.solved.state, np.arange(len(ties.prior.active)))[0] ** 2).sum())
    unknowns = int(ties.unknowns.free.sum()) + 3 * points_counted
    redundancy = observations - unknowns
    residual = np.where(observed, np.nan_to_num(solved.residual_m), 0.0)
    apriori = _squares(_apriori(problem, solved), residual)
    squares = _squares(solved.whiteners, residual)
    of_given = used & (np.arange(len(used)) >= n)
    of_strips = solved.solved.covariances().groups[STRIP]
    of_points, held = None, np.asarray(np.isfinite(mean[:, 0]))
    if points:
        of_points = solved.solved.covariances().groups[POINT]
        of_points = np.where(held[:, None, None], of_points, np.nan)
    return TiedResult(
        state=solved.state,
        sigma=np.sqrt(np.einsum("nii->ni", of_strips)),
        point_m=reduced + problem.base_m,
        mean_m=mean + problem.base_m,
        mean_covariance_m2=covariance,
        residual_m=np.where(observed, solved.residual_m, np.nan),
        active=use,
        size_m=np.where(observed, solved.size_m, np.nan),
        test=solved.test,
        above=found.above,
        tau_m=found.tau,
        observations=observations,
        unknowns=unknowns,
        sigma0=_ratio(apriori[counted].sum() + of_prior, redundancy),
        weighted_sigma0=_ratio(squares[counted].sum() + of_prior, redundancy),
        given_sigma0=_ratio(squares[of_given].sum(), solved.redundancy[of_given].sum()),
        given_redundancy=float(solved.redundancy[of_given].sum()),
        iterations=solved.iterations,
        settled=found.settled,
        uncontrolled=uncontrolled_observations(solved, counted),
        point_covariance_m2=of_points,
    )


def _counted(problem: TiedProblem[S], used: Bool) -> tuple[Bool, int]:
    """Observations in use that more than themselves determine, and how many points they touch."""
    edges = np.cumsum([0, *(len(r.active) for r in problem.records)])
    touched = [(first, b) for r, first in zip(problem.records, edges) for group, b in r.touches if group == POINT]
    n = problem.ties.n_points
    often = np.bincount(np.concatenate([b[used[first : first + len(b)]] for first, b in touched]), minlength=n)
    counted = used.copy()
    for first, b in touched:
        counted[first : first + len(b)] &= often[b] > 1
    met = [b[counted[first : first + len(b)]] for first, b in touched]
    return counted, len(np.unique(np.concatenate(met)))


def _apriori(problem: TiedProblem[S], solved: TiedSolution[S]) -> Sequence[Float]:
    """Whiteners without the added standard deviation."""
    typical = typical_variance(solved.eigenvalues, 0.0)
    own = tie_whitener(solved.eigenvalues, solved.eigenvectors, 0.0)
    return (own, *(g.whitener(typical) for g in problem.given))


def _squares(whiteners: Sequence[Float], residual_m: Float) -> Float:
    """Sum of squares of each observation's whitened residuals."""
    return np.asarray((np.einsum("nij,nj->ni", in_three(whiteners), residual_m) ** 2).sum(axis=1))


def _ratio(squares: float, redundancy: float) -> float:
    return float(np.sqrt(squares / redundancy)) if redundancy > 0 else float("nan")
