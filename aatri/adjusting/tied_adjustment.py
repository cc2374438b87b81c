"""Bodies tied by common points and by what is observed of the ground, adjusted together: weights, gross errors, tau.

Bodies are deformed: tau, what their points disagree by beyond their covariances, is estimated with the unknowns
(adjustment.statistics.variance_components); it is zero where the bodies agree as well as they should. Gross errors are
found by data snooping, and observations rejected before, here or in an earlier stage, are re-admitted where they fit
(adjustment.statistics.search). A tie is wrong only if it is off its neighbours in the same body too: long strips bend
more at the edge of a block than tau, which is one for all, and there all ties are off together.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from aatri.adjusting.added_variance import bent, weighted_means
from aatri.adjusting.adjusted_observations import AdjustedObservations
from aatri.adjusting.tied_problem import TiedProblem, in_three
from aatri.adjusting.tied_solution import TiedSolution, solve_tied, uncontrolled_observations
from aatri.adjustment.records import whitened
from aatri.adjustment.statistics.limits import limit_of_tests
from aatri.adjustment.statistics.rejection import Pool, Snooping, overfull, pool_of, room_left, room_of
from aatri.adjustment.statistics.search import Searched, SearchState, clearest_controlled, search
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int
from aatri.observations.poses import POINT, POSE
from aatri.observations.ties import BODY

SIMILARITY = 7
"""Coordinates that bring a body to the ground."""


@dataclass(frozen=True)
class TiedResult:
    """Result of a tied adjustment; all observations are the ties, then what is observed of the ground, kind by kind."""

    problem: TiedProblem
    observations: tuple[AdjustedObservations, ...]
    """Kind by kind."""
    state: State
    """All unknowns."""
    covariances: dict[str, Float]
    """Dict of str to (n, k, k). Of their groups, a priori; zero where held, NaN where they take no part."""
    xyz_m: Float
    """(n_points, 3), m. Adjusted ground points; NaN where no body holds the point."""
    mean_m: Float
    mean_covariance_m2: Float
    """(n_points, 3), (n_points, 3, 3), m, m^2. Weighted means over the bodies, what is observed of the ground not
    counted, and their covariances with the unknowns of the bodies held; tau is in them."""
    residuals: Float
    """(n, 3). Adjusted minus observed; NaN where not observed. For rejected observations that of a predicted value."""
    active: Bool
    """(n,)."""
    size: Float
    """(n, 3). Estimated gross error of each observation."""
    test: Float
    """(n,). Test statistic; NaN where it cannot be tested."""
    above: Bool
    """(n,). Used, though the test is above the limit: too many of the same body or kind are rejected already."""
    bent: Bool
    """(n,). Ties in use above the limit that are so because their body bends."""
    tau_m: float
    """What had to be added to the standard deviation of the bodies' points."""
    counts: tuple[int, int]
    """(int, int). Observations, coordinate by coordinate, and unknowns, with the ground points."""
    sigma0: float
    """Ratio to the a priori standard deviations, tau not counted; NaN without redundancy."""
    weighted_sigma0: float
    """The same with tau counted: near 1 where tau had to be added."""
    ground_sigma0: float
    ground_redundancy: float
    """That of what is observed of the ground alone, and the sum of its redundancy numbers."""
    iterations: int
    settled: bool
    """False if the search for gross errors was broken off."""
    uncontrolled: tuple[Int, Float, Float]
    """(k,) int64, (k,), (k, 3). Active observations that others at their point should control, and do not: rows,
    redundancy number, direction."""

    @property
    def redundancy(self) -> int:
        """Observations less unknowns."""
        return self.counts[0] - self.counts[1]

    def of(self, kind: str) -> Int:
        """Where the observations of a kind are among all, in the order of their rows."""
        part = [
            (o.row, first + np.arange(len(o)))
            for o, first in zip(self.problem.observed, self.problem.edges)
            if o.kind == kind
        ]
        if not part:
            return np.zeros(0, dtype=np.int64)
        row, place = (np.concatenate(parts) for parts in zip(*part))
        return np.asarray(place[np.argsort(row, kind="stable")])


def snooping_of(problem: TiedProblem, limit: float | None) -> Snooping:
    """Rules of the search by a limit; None: that of so many tests."""
    return Snooping(limit_of_tests(int(problem.components.sum())) if limit is None else limit)


def adjust_tied(
    problem: TiedProblem,
    snooping: Snooping,
    *,
    active: Bool | None = None,
    deformed: bool = True,
    undoubted: Bool | None = None,
    after: tuple[Bool, float] | None = None,
) -> TiedResult:
    """Adjust all bodies together, with data snooping and an estimate of their deformation.

    Parameters
    ----------
    active : (n,) bool, optional
        Observations to begin with; the others are tested for re-admission.
    deformed : bool
        Estimate the deformation of the bodies; else there is none.
    undoubted : (n,) bool, optional
        Observations that are not rejected.
    after : (n,) bool and float, m, optional
        What a search with the same bodies has left in use, and their deformation: where this one goes on.

    Raises
    ------
    GeometryError
        If the unknowns are not determined.
    ConvergenceError
        If the iteration does not converge.
    """
    near = (POINT, POSE) if POSE in problem.start else (POINT,)
    snooping = replace(snooping, neighbourhood=near, share=(BODY, snooping.share[1]))
    variances = np.concatenate([problem.spread(problem.start).values.sum(axis=1), problem.ground_variance])
    pool = pool_of(snooping, problem.records, [variances])

    def solve(before: TiedSolution | None, use: Bool, tau_m: float) -> TiedSolution:
        if before is None and after is None and deformed and not problem.is_small:
            before = solve_tied(problem, problem.start, use, 0.0, None, coarse=True)
            if before.added_sigma(robust=True) > 0:  # on the way to an adjustment with that
                return before
        return solve_tied(problem, problem.start if before is None else before.state, use, tau_m, before)

    room: list[Int] = []

    kept = np.zeros(len(variances), dtype=bool) if undoubted is None else undoubted

    def wrong(solved: TiedSolution, use: Bool) -> Bool:
        if not room:
            room.append(_room(solved, snooping, pool))
        doubtful = use & ~kept & ~bent_ties(solved, use, snooping.limit)
        return clearest_controlled(snooping, replace(pool, room=room[0]), solved, doubtful)

    begin = np.ones(len(variances), dtype=bool) if active is None else active
    use, tau_m = begin if after is None else after[0] | kept, 0.0 if after is None else after[1]
    searched = search(
        solve,
        use,
        snooping,
        pool,
        wrong,
        added=deformed,
        first=None if after is None else SearchState(solve(None, use, tau_m), tau_m, robust=False),
        lean=TiedSolution.lean,
    )
    # Where more of what is observed of the ground contradicts the rest than there is room for, all of its kind is kept.
    full = replace(pool, room=room[0]) if room else pool
    crowded, back = overfull(snooping, full, searched.above & ~pool.carrier, searched.active, begin)
    if room and back.any():
        room[0][crowded] = 0
        use, again = use | back, searched.first if after is None else None
        del searched
        searched = search(solve, use, snooping, pool, wrong, added=deformed, first=again, lean=TiedSolution.lean)
        del again
    bends = bent_ties(searched.solved, searched.active, snooping.limit)
    above = searched.above & ~kept & ~bends
    return _result(replace(searched, first=None, above=above), bends)  # the first is as large as the result


def bent_ties(solved: TiedSolution, use: Bool, limit: float) -> Bool:
    """Ties above the limit that are so because their body bends there, of all observations, (n,)."""
    bends, problem = np.zeros(len(use), dtype=bool), solved.problem
    for o, first, T, tests in zip(problem.ties, problem.edges, solved.whiteners, solved.tests):
        touched, part = dict(o.records.touches), slice(first, first + len(o))
        above = use[part] & (solved.test[part] > limit)
        if POINT not in touched or not above.any():
            continue
        body, point = touched[BODY].astype(np.int64), touched[POINT]
        together = np.bincount(point, body + 1).astype(np.int64)  # differs with the other bodies of the point
        rows = np.flatnonzero(np.isin(body, np.unique(body[above])))
        overlap = body[rows] * (int(together.max()) + 1) + together[point[rows]]
        in_all, redundancy = first + rows, tests.redundancy[rows]
        xyz, residual, test = solved.state[POINT][point[rows]], solved.residuals[in_all], solved.test[in_all]
        bends[in_all] = bent(overlap, xyz, residual, T[rows], redundancy, test, use[in_all], limit)
    return bends


def _room(solved: TiedSolution, snooping: Snooping, pool: Pool) -> Int:
    """How many may be rejected: of a body the share of the rule; of a kind also what the others answer for."""
    none = np.ones(len(pool.source), dtype=bool)
    room, sources = room_left(snooping, pool, none), int(pool.source.max()) + 1
    weights = np.where(pool.counted, solved.answered, 0.0)
    answered: Float = np.bincount(pool.source, weights, sources).astype(np.float64)
    # Whatever goes, seven coordinates and one to test them are left of all that is observed of the ground.
    problem = solved.problem
    spare = max(int(problem.components[problem.n_ties :].sum()) - SIMILARITY - 1, 0) // 3
    return np.maximum(room, np.minimum(room_of(answered, np.bincount(pool.source, minlength=sources)), spare))


def _result(searched: Searched[TiedSolution], bends: Bool) -> TiedResult:
    solved, use = searched.solved, searched.active
    problem, state, n = solved.problem, solved.state, solved.problem.n_ties
    observed = problem.components
    mean, covariance = _means(solved, use)
    counted, n_unknowns = _counted(problem, use & solved.taking_part)
    of_priors = [whitened(o.records, state, np.arange(len(o)))[0] for o in problem.priors]
    observations = int(observed[counted].sum()) + sum(v.size for v in of_priors)
    redundancy = observations - n_unknowns
    residual = np.where(observed, np.nan_to_num(solved.residuals), 0.0)
    prior = sum(float((v**2).sum()) for v in of_priors)
    apriori = _squares(problem.whiteners(solved.spread, 0.0), residual)
    squares = _squares(solved.whiteners, residual)
    of_ground = use & solved.taking_part & (np.arange(len(use)) >= n)
    return TiedResult(
        problem=problem,
        observations=tuple(_observations(solved)),
        state=state,
        covariances=solved.solved.covariances.groups,
        xyz_m=np.where(np.isfinite(mean), state[POINT], np.nan),
        mean_m=mean,
        mean_covariance_m2=covariance,
        residuals=np.where(observed, solved.residuals, np.nan),
        active=use,
        size=np.where(observed, solved.size, np.nan),
        test=solved.test,
        above=searched.above,
        bent=bends,
        tau_m=searched.tau,
        counts=(observations, n_unknowns),
        sigma0=_ratio(apriori[counted].sum() + prior, redundancy),
        weighted_sigma0=_ratio(squares[counted].sum() + prior, redundancy),
        ground_sigma0=_ratio(squares[of_ground].sum(), solved.redundancy[of_ground].sum()),
        ground_redundancy=float(solved.redundancy[of_ground].sum()),
        iterations=solved.iterations,
        settled=searched.settled,
        uncontrolled=uncontrolled_observations(solved, counted),
    )


def _observations(solved: TiedSolution) -> Iterator[AdjustedObservations]:
    """Kind by kind, with the weights of the adjustment."""
    problem, covariances = solved.problem, solved.solved.covariances.records
    for o, first, r, T, covariance in zip(
        problem.observed, problem.edges, problem.records, solved.whiteners, covariances
    ):
        part = slice(first, first + len(o))
        rows, used = np.flatnonzero(solved.taking_part[part]), (solved.use & solved.taking_part)[part]
        yield AdjustedObservations(o, rows, used, covariance, replace(r, whitener=T, active=used))


def _means(solved: TiedSolution, use: Bool) -> tuple[Float, Float]:
    """Weighted means of the ground points over the bodies."""
    problem, state = solved.problem, solved.state
    n_points, first = len(state[POINT]), 0
    for o, T in zip(problem.ties, solved.whiteners):
        touched = dict(o.records.touches)
        if POINT in touched:
            point = touched[POINT]
            part = slice(first, first + len(o))
            mean, covariance = weighted_means(point, -solved.residuals[part], T, use[part], n_points)
            return state[POINT] + mean, covariance  # of small numbers: they keep their digits
        first += len(o)
    return np.full((n_points, 3), np.nan), np.full((n_points, 3, 3), np.nan)


def _counted(problem: TiedProblem, used: Bool) -> tuple[Bool, int]:
    """Observations in use that more than themselves determine, and how many unknowns there are with what they touch."""
    counted, unknowns = used.copy(), 0
    for group in (POINT, POSE):
        touched = [
            (first, b) for o, first in zip(problem.observed, problem.edges) for g, b in o.records.touches if g == group
        ]
        if touched:
            free = next(u.free for u in problem.unknowns if u.name == group)
            part = np.concatenate([b[used[first : first + len(b)]] for first, b in touched])
            often = np.bincount(part, minlength=len(free))
            for first, b in touched:
                counted[first : first + len(b)] &= often[b] > 1
            met = [b[counted[first : first + len(b)]] for first, b in touched]
            unknowns += int(free[np.unique(np.concatenate(met))].sum())
    own = {u.name: int(u.free.sum()) for o in problem.observed for u in o.unknowns}
    return counted, unknowns + sum(own.values())


def _squares(whiteners: Sequence[Float], residual: Float) -> Float:
    """Sum of squares of each observation's whitened residuals."""
    return np.asarray((np.einsum("nij,nj->ni", in_three(whiteners), residual) ** 2).sum(axis=1))


def _ratio(squares: float, redundancy: float) -> float:
    return float(np.sqrt(squares / redundancy)) if redundancy > 0 else float("nan")
