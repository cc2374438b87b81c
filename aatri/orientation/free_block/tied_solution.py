"""One adjustment of strips tied by common points and by given coordinates, with the tests of all observations.

An observation whose gross error could be told only with a standard deviation of `WEAK` times that of the observation and
of a strip's point together is not rejected: hardly anything else determines what it determines, and without it the strips
would extrapolate.

Rejected observations stay in the adjustment with a weight of 1e-12: so they are predicted by the same adjustment, and
its index never changes. Points without an active observation in a strip take no part: their given coordinates count for
nothing, and they have no test.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np

from aatri.adjustment.adjust import Adjusted, adjust_large
from aatri.adjustment.covariance.marginal import marginal_covariances
from aatri.adjustment.records import Records
from aatri.adjustment.statistics.record_tests import RecordTests, record_tests
from aatri.adjustment.statistics.rejection import Snooping, pool_of
from aatri.adjustment.statistics.search import Searched, search
from aatri.adjustment.statistics.variance_components import added_sigma
from aatri.adjustment.unknowns import Unknowns, add_step
from aatri.arrays import Bool, Float, Text
from aatri.errors import ConvergenceError, GeometryError
from aatri.orientation.free_block.tie_records import (
    POINT,
    STRIP,
    GivenPoints,
    Ties,
    given_records,
    given_whitener,
    tie_records,
    tie_whitener,
    typical_variance,
    weighted,
)

S = TypeVar("S")

MAX_ITERATIONS = 30
DECREMENT = 1e-4
WEAK = 10.0
"""A redundancy number of 0.01: the limit of what counts as controlled at all (Foerstner 1980)."""

PREDICTED = 1e-6
"""Factor of the weight's root of what is only predicted."""


@dataclass(frozen=True)
class TiedProblem(Generic[S]):
    """Ties and given coordinates with their records; ground points are reduced to `base_m`."""

    ties: Ties[S]
    given: Sequence[GivenPoints]
    records: tuple[Records, ...]
    base_m: Float
    point_ids: Text
    what: str


@dataclass(frozen=True)
class TiedSolution(Generic[S]):
    """An adjustment with its tests; see adjustment.statistics.search."""

    problem: TiedProblem[S]
    adjusted: Adjusted
    whiteners: tuple[Float, ...]
    spectrum: tuple[Float, Float]
    root: Float
    sigma_m: Float
    residual_m: Float
    tests: RecordTests
    sigma: Float
    used: Bool
    iterations: int

    @property
    def state(self) -> S:
        """Unknowns of the strips."""
        found: Any = self.adjusted.state[STRIP]
        return found  # type: ignore[no-any-return]

    @property
    def controlled(self) -> Bool:
        """Observations whose gross error would be known well enough to reject them."""
        size = np.linalg.norm(self.size_m(), axis=1)
        with np.errstate(invalid="ignore"):
            return np.asarray(size < WEAK * self.sigma_m * self.tests.test)

    def size_m(self) -> Float:
        """Estimated gross errors, (n, 3), m."""
        n = len(self.problem.ties.strip)
        ties = np.einsum("nij,nj->ni", self.spectrum[1], self.tests.size[:n] * self.root)
        others = [np.linalg.pinv(T) for T in self.whiteners[1:]]
        given = np.einsum("nij,nj->ni", np.concatenate(others), self.tests.size[n:]) if others else np.zeros((0, 3))
        return np.concatenate([ties, given])

    def added_sigma(self, *, robust: bool) -> float:
        """The deformation that the residuals of the strips' points ask for, m."""
        n = len(self.problem.ties.strip)
        rows = self.used[:n]
        values, vectors = self.spectrum[0][rows], self.spectrum[1][rows]
        along = np.einsum("nji,nj->ni", vectors, self.residual_m[:n][rows])
        return added_sigma(along**2, values, self.tests.redundancy[:n][rows] / 3, robust=robust)


def tied_problem(ties: Ties[S], given: Sequence[GivenPoints], start: S, what: str) -> TiedProblem[S]:
    """The records of a problem; `what` is for messages."""
    base = np.zeros((ties.n_points, 3))
    base[ties.point[::-1]] = ties.on_ground(start, ties.rows)[0][::-1]
    records = (tie_records(ties, base), *(given_records(g, base) for g in given))
    return TiedProblem(ties, given, records, base, np.arange(ties.n_points).astype(np.str_), what)


def solve_tied(problem: TiedProblem[S], state: S, use: Bool, tau_m: float, before: TiedSolution[S] | None) -> TiedSolution[S]:
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
    root = np.sqrt(values + tau_m**2) if (values + tau_m**2).any() else np.ones_like(values)
    typical = typical_variance(values, tau_m)
    variances = [(root**2).sum(axis=1), *(np.einsum("nii->n", np.nan_to_num(g.covariance_m2)) for g in problem.given)]
    whiteners = (tie_whitener(values, vectors, tau_m), *(given_whitener(g, typical) for g in problem.given))
    n = len(ties.strip)
    held = np.bincount(ties.point[use[:n]], minlength=ties.n_points) > 0
    uses = np.split(use, np.cumsum([len(r.active) for r in problem.records])[:-1])
    records = [
        weighted(r, np.where(mine[:, None, None], T, PREDICTED * T), held[dict(r.touches)[POINT]])
        for r, T, mine in zip(problem.records, whiteners, uses)
    ]
    points = Unknowns(POINT, np.repeat(held[:, None], 3, axis=1), ("X", "Y", "Z"), problem.point_ids, add_step,
                      eliminated=True)  # fmt: skip
    start = {STRIP: state, POINT: _means(problem, state, whiteners[0], use[:n])}
    try:
        adjusted = adjust_large(
            [ties.unknowns, points], records, start, max_iterations=MAX_ITERATIONS, tolerance=DECREMENT
        )
    except (GeometryError, ConvergenceError) as error:
        raise type(error)(f"{problem.what}: {error.what}", where=error.where, remedy=error.remedy) from error
    covariances = marginal_covariances(adjusted)
    iterations = len(adjusted.history) + (before.iterations if before else 0)
    sigma = np.sqrt(np.einsum("nii->ni", covariances.groups[STRIP]))
    residuals, tests = [], []
    for k, (r, T, mine, R) in enumerate(zip(records, whiteners, uses, covariances.records)):
        v = np.where(r.active[:, None], r.residuals(adjusted.state), np.nan)
        adjusted_value = np.where(mine[:, None, None], R, R / PREDICTED**2)
        observed = None if k == 0 else problem.given[k - 1].given
        residuals.append(v)
        tests.append(record_tests(np.einsum("nij,nj->ni", T, v), adjusted_value, mine, observed))
    pooled = RecordTests(*(np.concatenate(parts) for parts in zip(*((t.size, t.test, t.redundancy) for t in tests))))
    used = use & np.concatenate([r.active for r in records])
    return TiedSolution(
        problem, adjusted, whiteners, (values, vectors), root, np.sqrt(np.concatenate(variances) + 3 * typical),
        np.concatenate(residuals), pooled, sigma, used, iterations,
    )  # fmt: skip


def _means(problem: TiedProblem[S], state: S, T: Float, use: Bool) -> Float:
    """Weighted means of the strips' points, reduced: where the ground points start."""
    ties = problem.ties
    xyz = ties.on_ground(state, ties.rows)[0] - problem.base_m[ties.point]
    return np.nan_to_num(weighted_means(ties, xyz, T, use)[0])


def weighted_means(ties: Ties[S], xyz: Float, T: Float, use: Bool) -> tuple[Float, Float]:
    """Weighted means of the strips' points over the strips.

    Parameters
    ----------
    ties : Ties
    xyz : (n, 3) float64, m
    T : (n, 3, 3) float64, 1/m
        Whitener of each.
    use : (n,) bool

    Returns
    -------
    mean : (n_points, 3) float64, m
        NaN where no strip holds the point.
    covariance : (n_points, 3, 3) float64, m^2
    """
    point, W = ties.point[use], T[use].swapaxes(1, 2) @ T[use]
    total = _summed(W, point, ties.n_points)
    held = np.bincount(point, minlength=ties.n_points) > 0
    total[~held] = np.eye(3)
    covariance: Float = np.linalg.inv(total).astype(np.float64)
    mean = np.einsum("nij,nj->ni", covariance, _summed(np.einsum("nij,nj->ni", W, xyz[use]), point, ties.n_points))
    mean[~held], covariance[~held] = np.nan, np.nan
    return mean, covariance


def _summed(values: Float, point: Any, n_points: int) -> Float:
    flat = values.reshape(len(values), -1)
    sums: Float = np.stack([np.bincount(point, column, n_points).astype(np.float64) for column in flat.T], axis=1)
    return sums.reshape(n_points, *values.shape[1:])
