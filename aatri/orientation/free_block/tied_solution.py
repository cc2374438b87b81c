"""One adjustment of strips tied by common points and by given coordinates, with the tests of all observations.

An observation whose gross error could be told only with a standard deviation of `WEAK` times that of the observation
and of a strip's point together is not rejected: hardly anything else determines what it determines, and without it the
strips would extrapolate.

Rejected observations stay in the index and are predicted by the others. Points without an active observation in a strip
take no part: their given coordinates count for nothing, and they have no test.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Generic, TypeVar

import numpy as np

from aatri.adjustment.elimination.reduced import reduced_normals
from aatri.adjustment.records import Records
from aatri.adjustment.solve import Solved, solve
from aatri.adjustment.statistics.record_tests import RecordTests
from aatri.adjustment.statistics.variance_components import common_sigma
from aatri.adjustment.structure.index_problem import prepare
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.structure.weights import Weights, with_weights
from aatri.adjustment.unknowns import Unknowns, add_step
from aatri.arrays import Bool, Float, Int
from aatri.errors import ConvergenceError, GeometryError
from aatri.orientation.free_block.tie_records import (
    POINT,
    STRIP,
    Given,
    GivenPoints,
    Ties,
    tie_records,
    tie_whitener,
    typical_variance,
)

S = TypeVar("S")

MAX_ITERATIONS = 30
LINEAR = 1e-5
"""An iteration ends when no residual departs from the linear model by more of its standard deviation."""

WEAK = 10.0
"""A redundancy number of 0.01: the limit of what counts as controlled at all (Foerstner 1980)."""


@dataclass(frozen=True)
class TiedProblem(Generic[S]):
    """Ties and given coordinates with the index of their adjustment; ground points are reduced to `base_m`."""

    ties: Ties[S]
    given: Sequence[Given]
    index: IndexedProblem
    base_m: Float
    what: str

    @property
    def records(self) -> tuple[Records, ...]:
        """Ties, then given coordinates kind by kind."""
        return self.index.records[: 1 + len(self.given)]


@dataclass(frozen=True)
class TiedSolution(Generic[S]):
    """An adjustment with its tests; see adjustment.statistics.search.

    Attributes
    ----------
    problem : TiedProblem
    solved : Solved
    whiteners : tuple of (n, 3, 3) float64, 1/m
    eigenvalues, eigenvectors : (n, 3), (n, 3, 3) float64
        Of the covariances of the ties, tau not counted.
    tau_m : float, m
    held : (n,) bool
        Observations whose point some active tie holds.
    use : (n,) bool
        Active observations.
    iterations : int
        Up to here.
    """

    problem: TiedProblem[S]
    solved: Solved
    whiteners: tuple[Float, ...]
    eigenvalues: Float
    eigenvectors: Float
    tau_m: float
    held: Bool
    use: Bool
    iterations: int

    @property
    def state(self) -> S:
        """Unknowns of the strips."""
        found: Any = self.solved.state[STRIP]
        return found  # type: ignore[no-any-return]

    @cached_property
    def tests(self) -> Mapping[str, RecordTests]:
        """By kind."""
        return self.solved.tests()

    def _all(self, column: str) -> Float:
        """A column of the tests of all observations; NaN where no tie holds the point."""
        found = in_three([getattr(self.tests[r.name], column) for r in self.problem.records])
        if not self.held.all():
            found[~self.held] = np.nan
        return found

    @cached_property
    def test(self) -> Float:
        """Test statistics of all observations; NaN where not defined."""
        return self._all("test")

    @cached_property
    def residual_m(self) -> Float:
        """Adjusted minus observed, (n, 3), m; NaN where no tie holds the point."""
        found = in_three([self._of_ties(self._tie_tests.whitened), *(self.tests[g.kind].v for g in self.problem.given)])
        found[~self.held] = np.nan
        return found

    @cached_property
    def redundancy(self) -> Float:
        """Sum of the redundancy numbers of each observation, (n,)."""
        return np.concatenate([np.einsum("nii->n", self.tests[r.name].redundancy) for r in self.problem.records])

    @cached_property
    def answered(self) -> Float:
        """How well the others know what is given, (n,): 1 where as well as a single point of a strip; 0 for ties.

        The redundancy number does not tell it: precise control beside rough strips has one near zero, and its gross
        errors show in the strips all the same (see `uncontrolled_ties`).
        """
        s2, first = self.variance_with_strip_m2 / 3, len(self.problem.ties.strip)
        found = [np.zeros(first)]
        for given, T in zip(self.problem.given, self.whiteners[1:]):
            R = self.tests[given.kind].redundancy
            own = np.einsum("nii->n", R)
            if isinstance(given, GivenPoints):
                own = s2[first : first + len(R)] * (T * (R @ T)).sum(axis=(1, 2))
            components = np.maximum(given.given.sum(axis=1), 1)
            found.append(np.clip(np.nan_to_num(own / components), 0.0, 1.0))
            first += len(R)
        return np.concatenate(found)

    @cached_property
    def size_m(self) -> Float:
        """Estimated gross errors, (n, 3), m."""
        return self._sizes_m(np.arange(len(self.use)))

    def _sizes_m(self, rows: Int) -> Float:
        """Those of some observations, ascending."""
        size, n = self._all("size")[rows], len(self.problem.ties.strip)
        ties = rows[rows < n]
        own = self._of_ties(size[: len(ties)], ties)
        others: list[Float] = [np.asarray(np.linalg.pinv(T), dtype=np.float64) for T in self.whiteners[1:]]
        if not others:
            return own
        given = np.einsum("nij,nj->ni", in_three(others)[rows[len(ties) :] - n], size[len(ties) :])
        return np.concatenate([own, given])

    @property
    def _tie_tests(self) -> RecordTests:
        return self.tests[self.problem.records[0].name]

    def _of_ties(self, whitened: Float, rows: Int | slice = slice(None)) -> Float:
        """Whitened values of ties in metres: along the eigenvectors of their covariances (`tie_whitener`)."""
        found: Float = np.einsum("nij,nj->ni", self.eigenvectors[rows], whitened * np.sqrt(self._variances(rows)))
        return found

    def _variances(self, rows: Int | slice = slice(None)) -> Float:
        values = self.eigenvalues[rows] + self.tau_m**2
        return values if self.tau_m > 0 or self.eigenvalues.any() else np.ones_like(values)

    @cached_property
    def variance_with_strip_m2(self) -> Float:
        """Variances of all observations and a strip's point together, summed over the axes, (n,), m^2."""
        own = [self._variances().sum(axis=1), *(g.variance for g in self.problem.given)]
        return np.asarray(np.concatenate(own) + 3 * typical_variance(self.eigenvalues, self.tau_m))

    def controlled(self, rows: Int) -> Bool:
        """Whether the gross errors of some observations, ascending, would be known well enough to reject them."""
        sigma = np.sqrt(self.variance_with_strip_m2[rows])
        with np.errstate(invalid="ignore"):
            return np.asarray(np.linalg.norm(self._sizes_m(rows), axis=1) < WEAK * sigma * self.test[rows])

    def added_sigma(self, *, robust: bool) -> float:
        """The deformation that the residuals of the strips' points ask for, m."""
        if not self.eigenvalues.any():
            return 0.0
        n, of_ties = len(self.problem.ties.strip), self._tie_tests
        share = np.where((self.use & self.held)[:n], np.einsum("nii->n", of_ties.redundancy) / 3, np.nan)
        return common_sigma(of_ties.whitened**2 * self._variances(), self.eigenvalues, share, robust=robust)


def tied_problem(ties: Ties[S], given: Sequence[Given], start: S, what: str) -> TiedProblem[S]:
    """Index a problem; `what` is for messages."""
    base = np.zeros((ties.n_points, 3))
    base[ties.point[::-1]] = ties.on_ground(start, ties.rows)[::-1]
    tied = np.bincount(ties.point, minlength=ties.n_points) > 0
    points = Unknowns(POINT, np.repeat(tied[:, None], 3, axis=1), ("X", "Y", "Z"), np.arange(ties.n_points).astype(str),
                      add_step, eliminated=True)  # fmt: skip
    records = (tie_records(ties, base), *(g.records(base) for g in given))
    every = records if ties.prior is None else (*records, ties.prior)
    return TiedProblem(ties, given, prepare([ties.unknowns, points], every), base, what)


def solve_tied(
    problem: TiedProblem[S], state: S, use: Bool, tau_m: float, before: TiedSolution[S] | None
) -> TiedSolution[S]:
    """Adjust with some active observations and an added standard deviation.

    Raises
    ------
    GeometryError
        If the unknowns are not determined.
    ConvergenceError
        If the iteration does not converge.
    """
    ties = problem.ties
    values, vectors = ties.spectrum(state)
    index = problem.index
    if before is not None and before.tau_m == tau_m and before.eigenvalues is values:
        index, whiteners = before.solved.problem, before.whiteners  # with what was put in order for them
    else:
        typical = typical_variance(values, tau_m) if problem.given else 1.0
        whiteners = (tie_whitener(values, vectors, tau_m), *(g.whitener(typical) for g in problem.given))
    held = _held(problem, use)
    weights = _weights(problem, use & held, whiteners)
    # The ground points are linear: where they start makes no difference.
    full: dict[str, Any] = {STRIP: state, POINT: np.zeros((ties.n_points, 3))}
    done = before.iterations if before else 0
    for iteration in range(1, MAX_ITERATIONS + 1):
        try:
            solved = solve(index, full, weights)
        except (GeometryError, ConvergenceError) as error:
            raise type(error)(f"{problem.what}: {error.what}", where=error.where, remedy=error.remedy) from error
        if _nearly_linear(problem, full, solved, values + tau_m**2):
            return TiedSolution(problem, solved, whiteners, values, vectors, tau_m, held, use, done + iteration)
        full = solved.state
    raise ConvergenceError(
        f"{problem.what} did not converge in {MAX_ITERATIONS} iterations",
        remedy="look for wrong point numbers in the largest discrepancies; check the principal distance and its unit, "
        "and whether X and Y of the control are exchanged or left-handed against the observed positions",
    )


def _nearly_linear(problem: TiedProblem[S], before: Mapping[str, Any], solved: Solved, variances: Float) -> bool:
    """Whether no residual departs too far from the linear model: by a bound of all, which costs little, or by each."""
    bend_m, least = problem.ties.bend_m, float(variances.min(initial=np.inf))
    if bend_m is not None and least > 0 and bend_m(before[STRIP], solved.state[STRIP]) <= LINEAR * np.sqrt(least):
        return True
    return solved.departure <= LINEAR


def reduced_matrix(problem: TiedProblem[S], state: S, use: Bool, whiteners: Sequence[Float]) -> Float:
    """Normal matrix of the strips' unknowns, the ground points eliminated, of some observations with given weights."""
    weights = _weights(problem, use & _held(problem, use), whiteners)
    full: dict[str, Any] = {STRIP: state, POINT: np.zeros((problem.ties.n_points, 3))}
    return reduced_normals(with_weights(problem.index, weights), full).N


def weighted_problem(problem: TiedProblem[S], state: S, use: Bool) -> IndexedProblem:
    """The problem with the weights of a state, tau not counted, and some active observations."""
    values, vectors = problem.ties.spectrum(state)
    typical = typical_variance(values, 0.0) if problem.given else 1.0
    whiteners = (tie_whitener(values, vectors, 0.0), *(g.whitener(typical) for g in problem.given))
    return with_weights(problem.index, _weights(problem, use & _held(problem, use), whiteners))


def _held(problem: TiedProblem[S], use: Bool) -> Bool:
    """Observations whose points, if they have any, some active tie holds."""
    ties = problem.ties
    points = np.bincount(ties.point[use[: len(ties.strip)]], minlength=ties.n_points) > 0
    found = []
    for r in problem.records:
        tied = [points[block] for group, block in r.touches if group == POINT]
        found.append(np.logical_and.reduce([np.ones(len(r.active), dtype=bool), *tied]))
    return np.concatenate(found)


def _weights(problem: TiedProblem[S], use: Bool, whiteners: Sequence[Float]) -> dict[str, Weights]:
    parts = np.split(use, np.cumsum([len(T) for T in whiteners])[:-1])
    return {r.name: Weights(mine, T) for r, T, mine in zip(problem.records, whiteners, parts)}


def in_three(parts: Sequence[Float]) -> Float:
    """Columns (n,), residuals (n, k) or matrices (n, k, k) of all observations, k filled up to three with zeros."""
    filled = []
    for part in parts:
        lacking = 0 if part.ndim == 1 else 3 - part.shape[-1]
        filled.append(np.pad(part, [(0, 0), *[(0, lacking)] * (part.ndim - 1)]) if lacking else part)
    return np.concatenate(filled)
