"""Tests of the records of a bundle: the largest |w| of each, of predictions where it is rejected."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from aatri.adjusting.adjusted_observations import AdjustedObservations
from aatri.adjustment.records import whitened_residuals
from aatri.adjustment.statistics.leave_one_out import gains_of_leaving_out
from aatri.adjustment.statistics.limits import CONTROLLED_COMPONENT, ESTIMABLE_REDUNDANCY, SINGLE_LIMIT
from aatri.adjustment.statistics.reliability import tau_limit
from aatri.adjustment.threads import by_rows
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int
from aatri.observations.observed import Observed
from aatri.observations.poses import is_additional
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.blunders.all_records import is_ray
from aatri.orientation.bundle.blunders.search_options import SearchOptions
from aatri.orientation.bundle.result import BundleResult


@dataclass(frozen=True)
class TestedBlock:
    """A block adjusted without some of its records, and the tests of all of them."""

    block: BundleInput
    result: BundleResult
    active: Bool
    options: SearchOptions
    tails: Float
    """Limit of each record over that of normal errors, (n,)."""

    @cached_property
    def largest_w(self) -> Float:
        """Largest |w| of each record, kind after kind; predicted where not active."""
        return np.concatenate([tests_of(o, self.result.adjusted.state) for o in self.result.observations])

    @property
    def low_redundancy(self) -> bool:
        """Whether there is too little redundancy to tell a gross error from wrong standard deviations by |w| alone."""
        return self.result.adjusted.redundancy < ESTIMABLE_REDUNDANCY

    @cached_property
    def test(self) -> Float:
        """|w| over the limit's unit: with little redundancy a gross error is one that also stands out of the others."""
        adjusted, limit, unit = self.result.adjusted, self.options.w_limit, 1.0
        if self.options.tau:
            unit = adjusted.sigma0 * tau_limit(limit, adjusted.redundancy) / limit
        elif self.low_redundancy and adjusted.redundancy > 0:
            unit = max(1.0, adjusted.sigma0 * tau_limit(min(limit, SINGLE_LIMIT), adjusted.redundancy) / limit)
        return np.asarray(self.largest_w / (unit * self.tails))

    def controlled(self, rows: Int) -> Bool:
        """All that has a test is controlled well enough."""
        return np.ones(len(rows), dtype=bool)

    def added_sigma(self, *, robust: bool) -> float:  # noqa: ARG002
        """A bundle adds nothing to its standard deviations."""
        return 0.0


def tests_of(observations: AdjustedObservations, state: State) -> Float:
    """Largest |w| of the components of each record of one kind, (n,); NaN without test, see `record_tests`."""
    test = np.full(len(observations.observed), np.nan)
    if len(observations.rows) and not (observations.observed.exact or observations.observed.components):
        v, r = residuals_and_redundancy(observations, state, observations.rows)
        test[observations.rows] = by_rows(_largest_w, v, r)
    return test


def _largest_w(v: Float, r: Float) -> Float:
    w = np.where(r > 0, np.abs(v) / np.sqrt(np.where(r > 0, r, 1.0)), -1.0).max(axis=1)
    return np.where(w >= 0, w, np.nan)


def tests_in_use(result: BundleResult) -> Float:
    """|w| of all observations in use that have one, after a zero."""
    tests = np.concatenate([np.zeros(1), *(tests_of(o, result.adjusted.state)[o.used] for o in result.observations)])
    return np.asarray(tests[np.isfinite(tests)])


def misfit(result: BundleResult, limit: float) -> float:
    """Sum of squares of what is in use above the limit."""
    tests = tests_in_use(result)
    return float((tests[tests > limit] ** 2).sum())


def residuals_and_redundancy(observations: AdjustedObservations, state: State, rows: Int) -> tuple[Float, Float]:
    """Whitened residuals and redundancy numbers, (k, m) each; of what has no test the second is zero.

    What is out has 1 over the redundancy number that it would have if it were used: a ray predicted so badly that
    nothing would control it then has no test either, for it would fit wherever it is. Of other kinds that is no reason:
    control may be far more precise than the block predicts it.
    """
    records = observations.observed.records
    most = 1.0 / CONTROLLED_COMPONENT if is_ray(observations.observed) else np.inf
    observed = records.observed_components()

    def redundancy(rows: Int) -> Float:
        used = records.active[rows][:, None]
        r = 1.0 + np.where(used, -1.0, 1.0) * np.einsum("nii->ni", observations.covariance[rows])
        is_controlled = np.where(used, r > CONTROLLED_COMPONENT, r < most)
        return np.where(observed[rows] & is_controlled, r, 0.0)

    return whitened_residuals(records, state, rows), by_rows(redundancy, rows)


def gains_of(observations: AdjustedObservations, state: State, rows: Int) -> Float:
    """What leaving out each of some observations would gain, (k,); of one that is out, what it would cost to use it."""
    records = observations.observed.records
    gain, has_covariance = np.full(len(rows), np.nan), np.isfinite(observations.covariance[rows]).all(axis=(1, 2))
    if has_covariance.any():
        predicted = rows[has_covariance]
        used = np.where(records.active[predicted], 1.0, -1.0)[:, None, None]
        v = whitened_residuals(records, state, predicted)
        gain[has_covariance] = gains_of_leaving_out(v, used * observations.covariance[predicted])
    return gain


def least_squares_covariance(observations: AdjustedObservations, least_squares: BundleResult | None, i: int) -> Float:
    """Covariances of the adjusted values as least squares has them; zero where it failed."""
    return np.zeros_like(observations.covariance) if least_squares is None else least_squares.observations[i].covariance


def residuals_beside(
    result: BundleResult, least_squares: BundleResult | None, i: int, rows: Int
) -> tuple[Float, Float]:
    """`residuals_and_redundancy` of the i-th observations; by the covariances of least squares, if there are such."""
    observations = result.observations[i]
    if least_squares is not None:
        observations = replace(observations, covariance=least_squares_covariance(observations, least_squares, i))
    return residuals_and_redundancy(observations, result.adjusted.state, rows)


def largest_gain_beside(result: BundleResult, place: int) -> float:
    """The most that leaving out a value given, or a record of a kind but that at `place` and rays, would gain."""
    others = [
        o
        for i, o in enumerate(result.observations)
        if i != place and (is_prior(o.observed) or (o.observed.is_measured and not is_ray(o.observed)))
    ]
    gains = [gains_of(o, result.adjusted.state, np.flatnonzero(o.used)) for o in others]
    return float(np.nanmax(np.concatenate([np.zeros(1), *gains])))


def is_prior(o: Observed) -> bool:
    """Whether this is what is known of cameras, film or mounts beforehand."""
    return not (o.is_measured or o.exact) and not any(is_additional(group) for group, _ in o.records.touches)
