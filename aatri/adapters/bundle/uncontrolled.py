"""Observations that nothing controls, as a table: of all kinds, from the covariances at hand."""

import numpy as np

from aatri.adapters.observation_tables import uncontrolled_table
from aatri.adapters.solution import stacked
from aatri.adjusting.adjusted_observations import AdjustedObservations
from aatri.adjustment.statistics.record_tests import BELOW, uncontrolled_directions
from aatri.arrays import Float, Int
from aatri.artifacts.suspects import Uncontrolled
from aatri.orientation.bundle.result import BundleResult


def uncontrolled_of(result: BundleResult) -> Uncontrolled | None:
    """Observations in use with a direction whose redundancy number is below 0.01.

    Parameters
    ----------
    result : BundleResult
        None without covariances.
    """
    determined = [o for o in result.observations if not o.observed.exact and np.isfinite(o.covariance[o.used]).any()]
    if result.adjusted.down_weighted or not determined:
        return None
    return stacked([Uncontrolled.empty(), *map(_of_kind, determined)])


def _of_kind(adjusted: AdjustedObservations) -> Uncontrolled:
    o = adjusted.observed
    rows = adjusted.rows[adjusted.used[adjusted.rows]]
    records, m = o.records, o.records.rows
    R = np.eye(m) - adjusted.covariance[rows]
    observed = records.observed_components()[rows]
    if o.components:
        return _of_parameters(adjusted, rows, R)
    weak, least, direction = uncontrolled_directions(R, observed, records.whitener[rows])
    return uncontrolled_table(o, rows[weak], least, direction)


def _of_parameters(adjusted: AdjustedObservations, rows: Int, R: Float) -> Uncontrolled:
    """Of weighted parameters one by one: they have no common direction."""
    o, r = adjusted.observed, np.einsum("nii->ni", R)
    weighted = np.isfinite(o.sigmas()[rows])
    row, component = np.nonzero(weighted & (np.where(weighted, r, 1.0) < BELOW))
    label = np.array(o.components, dtype=np.str_)[component]
    return uncontrolled_table(o, rows[row], r[row, component], np.full((len(row), 1), np.nan), label)
