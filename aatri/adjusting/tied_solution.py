"""One adjustment of bodies tied by common points and by what is observed of the ground, with the tests of all.

An observation whose gross error could be told only with a standard deviation of `WEAK` times that of the observation
and of a body's point together is not rejected: hardly anything else determines what it determines, and without it the
bodies would extrapolate.

Rejected observations stay in the index and are predicted by the others. Points and images without an active tie take no
part: what is observed of them counts for nothing, and has no test.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from aatri.adjusting.acceleration import Course
from aatri.adjusting.added_variance import typical_variance
from aatri.adjusting.tied_problem import TiedProblem, in_three, is_coordinates
from aatri.adjustment.covariance.dense import DenseSolution, solve_dense
from aatri.adjustment.covariance.solve import LinearSolution, solve
from aatri.adjustment.kernels.spectra import is_steady
from aatri.adjustment.statistics.limits import LEAST_CONTROLLED
from aatri.adjustment.statistics.record_tests import RecordTests, uncontrolled_directions
from aatri.adjustment.statistics.variance_components import common_sigma
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int
from aatri.errors import ConvergenceError, GeometryError
from aatri.observations.observed import Spread
from aatri.observations.poses import POINT

MAX_ITERATIONS = 30
LINEAR = 1e-5
"""An iteration ends when no residual departs from the linear model by more of its standard deviation."""

ROUNDING = 1e-4
"""Below it rounding may keep that: strips of 100 km that tie to cm stay at 2e-5 to 5e-5, contradictions creep to it."""

COARSE = 1e-2
"""The same for an adjustment that the deformation of bodies is estimated from: that is then wrong by 1e-4 of itself."""

STEADY = 1e-3
"""Covariances of ties that turned by a smaller share of themselves stay: a result moves by that share of its sigma."""

TURNS = 5
"""Adjustments, each with the covariances of the one before, after which these are near enough in any case."""

AT_A_TIME = 20_000
"""Observations whose matrices are turned at once, where all are looked at."""

WEAK = LEAST_CONTROLLED**-0.5
"""Ten: a redundancy number of 0.01 is the limit of what counts as controlled at all (Foerstner 1980)."""


@dataclass(frozen=True)
class TiedSolution:
    """An adjustment with its tests; see adjustment.statistics.search."""

    problem: TiedProblem
    solved: LinearSolution | DenseSolution
    whiteners: tuple[Float, ...]
    """Tuple of (n, m, m). Kind by kind."""
    spread: Spread
    """Of the ties, tau not counted."""
    tau_m: float
    taking_part: Bool
    """(n,). Observations whose point some active tie holds."""
    use: Bool
    """(n,). Active observations."""
    iterations: int
    """Up to here."""

    @property
    def state(self) -> State:
        """All unknowns."""
        return self.solved.state

    def lean(self) -> TiedSolution:
        """The same without its tests and covariances, which are made again where they are asked for."""
        return replace(self, solved=replace(self.solved))

    @cached_property
    def tests(self) -> tuple[RecordTests, ...]:
        """Kind by kind."""
        by_key = self.solved.tests()
        return tuple(by_key[key] for key in self.problem.keys)

    def _all(self, column: str) -> Float:
        """A column of the tests of all observations; NaN where no tie holds the point."""
        of_all = in_three([getattr(tests, column) for tests in self.tests])
        if not self.taking_part.all():
            of_all[~self.taking_part] = np.nan
        return of_all

    @cached_property
    def test(self) -> Float:
        """Test statistics of all observations; NaN where not defined."""
        return self._all("test")

    @cached_property
    def residuals(self) -> Float:
        """Adjusted minus observed, (n, 3); NaN where no tie holds the point."""
        of_ties = self._of_ties(np.concatenate([tests.whitened for tests in self._tests_of_ties]))
        of_all = in_three([of_ties, *(tests.v for tests in self.tests[len(self.problem.ties) :])])
        of_all[~self.taking_part] = np.nan
        return of_all

    @cached_property
    def redundancy(self) -> Float:
        """Sum of the redundancy numbers of each observation, (n,)."""
        return np.concatenate([np.einsum("nii->n", tests.redundancy) for tests in self.tests])

    @cached_property
    def answered(self) -> Float:
        """How well the others know what is observed of the ground, (n,): 1 where as well as a single point of a body.

        0 for ties. The redundancy number does not tell it: precise control beside rough bodies has one near zero, and
        its gross errors show in the bodies all the same (see `uncontrolled_observations`).
        """
        problem, k = self.problem, len(self.problem.ties)
        s2, shares = self.variance_with_body / 3, [np.zeros(problem.n_ties)]
        for o, first, tests, T in zip(problem.ground, problem.edges[k:], self.tests[k:], self.whiteners[k:]):
            R, own = tests.redundancy, np.einsum("nii->n", tests.redundancy)
            if is_coordinates(o):
                own = s2[first : first + len(R)] * (T * (R @ T)).sum(axis=(1, 2))
            components = np.maximum(problem.components[first : first + len(R)].sum(axis=1), 1)
            shares.append(np.clip(np.nan_to_num(own / components), 0.0, 1.0))
        return np.concatenate(shares)

    @cached_property
    def size(self) -> Float:
        """Estimated gross errors, (n, 3)."""
        return self._sizes(np.arange(len(self.use)))

    def _sizes(self, rows: Int) -> Float:
        """Those of some observations, ascending."""
        size, n = self._all("size")[rows], self.problem.n_ties
        ties = rows[rows < n]
        own = self._of_ties(size[: len(ties)], ties)
        others: list[Float] = [np.linalg.pinv(T).astype(np.float64) for T in self.whiteners[len(self.problem.ties) :]]
        if not others:
            return own
        ground = np.einsum("nij,nj->ni", in_three(others)[rows[len(ties) :] - n], size[len(ties) :])
        return np.concatenate([own, ground])

    @property
    def _tests_of_ties(self) -> tuple[RecordTests, ...]:
        return self.tests[: len(self.problem.ties)]

    def _of_ties(self, whitened: Float, rows: Int | slice = slice(None)) -> Float:
        """Whitened values of ties in metres: along the eigenvectors of their covariances (`tie_whitener`)."""
        return np.asarray(np.einsum("nij,nj->ni", self.spread.vectors[rows], whitened * np.sqrt(self._variances(rows))))

    def _variances(self, rows: Int | slice = slice(None)) -> Float:
        values = self.spread.values[rows] + self.tau_m**2
        return values if self.tau_m > 0 or self.spread.values.any() else np.ones_like(values)

    @cached_property
    def variance_with_body(self) -> Float:
        """Variances of all observations and a body's point together, summed over the axes, (n,)."""
        own = np.concatenate([self._variances().sum(axis=1), self.problem.ground_variance])
        return own + 3 * typical_variance(self.spread, self.tau_m)

    def controlled(self, rows: Int) -> Bool:
        """Whether the gross errors of some observations, ascending, would be known well enough to reject them."""
        sigma = np.sqrt(self.variance_with_body[rows])
        with np.errstate(invalid="ignore"):
            return np.asarray(np.linalg.norm(self._sizes(rows), axis=1) < WEAK * sigma * self.test[rows])

    def added_sigma(self, *, robust: bool) -> float:
        """The deformation that the residuals of the bodies' points ask for, m."""
        if not self.spread.values.any():
            return 0.0
        squares = np.concatenate([tests.whitened for tests in self._tests_of_ties]) ** 2
        squares *= self._variances()
        share = np.concatenate([np.einsum("nii->n", tests.redundancy) / 3 for tests in self._tests_of_ties])
        share = np.where((self.use & self.taking_part)[: len(share)], share, np.nan)
        return common_sigma(squares, self.spread.values, share, robust=robust)


def solve_tied(
    problem: TiedProblem, state: State, use: Bool, tau_m: float, before: TiedSolution | None, *, coarse: bool = False
) -> TiedSolution:
    """Adjust with some active observations and an added standard deviation.

    The covariances of the ties are those of the bodies as they are turned at the end; if `coarse`, at the start.

    Raises
    ------
    GeometryError
        If the unknowns are not determined.
    ConvergenceError
        If the iteration does not converge.
    """
    solution = _solved(problem, state, use, tau_m, before, COARSE if coarse else LINEAR)
    for _ in range(0 if coarse else TURNS):
        if _is_steady(solution.spread, problem.spread(solution.state), tau_m):
            break
        solution = _solved(problem, solution.state, use, tau_m, solution, LINEAR)
    return solution


def _solved(
    problem: TiedProblem, state: State, use: Bool, tau_m: float, before: TiedSolution | None, linear: float
) -> TiedSolution:
    """The same with the covariances that the ties have at a state, until no residual departs by more than `linear`."""
    spread = problem.spread(state)
    same_weights = before is not None and before.tau_m == tau_m and before.spread.values is spread.values
    whiteners = before.whiteners if before and same_weights else problem.whiteners(spread, tau_m)
    taking_part, solved_before = problem.taking_part(use), before.solved if before and same_weights else None
    ordered = solved_before.problem if isinstance(solved_before, LinearSolution) else None
    step = _step(problem, use & taking_part, whiteners, ordered)  # with what was put in order for them
    full: dict[str, Any] = {**state, POINT: problem.start[POINT]}  # the points are linear: any start does
    done, last = before.iterations if before else 0, list[float]()
    course: Course | None = None
    for iteration in range(1, MAX_ITERATIONS + 1):
        try:
            solved = step(full)
        except (GeometryError, ConvergenceError) as error:
            kind = GeometryError if isinstance(error, GeometryError) else ConvergenceError
            raise kind(f"{problem.what}: {error.what}", where=error.where, remedy=error.remedy) from error
        last = [*last[-2:], solved.departure]
        at_rounding = len(last) == 3 and last[2] <= ROUNDING and min(last[1:]) > 0.5 * last[0]  # twice not halved
        if last[-1] <= linear or at_rounding:
            return TiedSolution(problem, solved, whiteners, spread, tau_m, taking_part, use, done + iteration)
        if isinstance(solved, DenseSolution):
            full = solved.state
            continue
        course = course or Course([u for u in problem.unknowns if u.name != POINT])  # points are linear
        full = course.after(full, solved)
    raise ConvergenceError(
        f"{problem.what} did not converge in {MAX_ITERATIONS} iterations{problem.farthest_off(full)}",
        remedy="check numbers and coordinates of what is farthest off, the principal distance and its unit, "
        "and whether X and Y of the control are exchanged or left-handed against the observed positions",
    )


def _is_steady(before: Spread, after: Spread, tau_m: float) -> bool:
    """Whether the covariances of no tie have changed with its body."""
    if before.values is after.values:
        return True
    values, vectors = np.ascontiguousarray(before.values), np.ascontiguousarray(before.vectors)
    values_after, vectors_after = np.ascontiguousarray(after.values), np.ascontiguousarray(after.vectors)
    return bool(is_steady(0, len(values), values, vectors, values_after, vectors_after, tau_m**2, STEADY))


def _step(
    problem: TiedProblem, use: Bool, whiteners: Sequence[Float], ordered: IndexedProblem | None
) -> Callable[[State], LinearSolution | DenseSolution]:
    """One step from a state: as whole matrices where the problem is small and determined, else by fronts."""
    weights = problem.weights(use, whiteners)
    weighted = zip(problem.records, np.split(use, problem.edges[1:-1]), whiteners)
    changed = [replace(r, active=active, whitener=whitener) for r, active, whitener in weighted]
    records = (*changed, *problem.all_records[len(changed) :])

    def step(state: State) -> LinearSolution | DenseSolution:
        dense = solve_dense(problem.unknowns, records, state) if problem.is_small else None
        return dense or solve(ordered or problem.index, state, weights)

    return step


def uncontrolled_observations(solved: TiedSolution, among: Bool) -> tuple[Int, Float, Float]:
    """Observations in which a gross error of ten standard deviations, of them and a body's point, shows not.

    A gross error e of an observation, whitener T, changes the sum of squares of the adjustment by e' T' R T e, with R
    the cofactor of its whitened residuals. It is compared with one standard deviation s of the observation and of a
    body's point together: precise control has a redundancy number near zero beside bodies ten times as rough, but its
    errors show in them. So the smallest eigenvalue of s^2 T' R T is the redundancy number, and its eigenvector the
    direction, whatever the weights. Source: Foerstner 1980, 1983.

    Parameters
    ----------
    among : (n,) bool
        Active observations to be looked at: ties, and coordinates of the ground.

    Returns
    -------
    rows : (k,) int64
    least : (k,) float64
        Redundancy number in that direction.
    direction : (k, 3) float64
        Of length 1; zero where not observed.
    """
    problem, each = solved.problem, zip(solved.problem.observed, solved.problem.edges, solved.tests, solved.whiteners)
    parts = [(np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros((0, 3)))]
    for o, first, tests, whitener in each:
        active = np.flatnonzero(among[first : first + len(o)]) if is_coordinates(o) else np.zeros(0, dtype=np.int64)
        for begin in range(0, len(active), AT_A_TIME):
            own = active[begin : begin + AT_A_TIME]
            rows, R, T = first + own, tests.redundancy[own], whitener[own]
            M = solved.variance_with_body[rows][:, None, None] / 3 * (T.swapaxes(1, 2) @ R @ T)
            weak, least, direction = uncontrolled_directions(M, problem.components[rows], np.ones((len(rows), 3)))
            parts.append((rows[weak], np.maximum(least, 0.0), direction))
    all_rows, all_least, all_directions = zip(*parts)
    return np.concatenate(all_rows), np.concatenate(all_least), np.concatenate(all_directions)
