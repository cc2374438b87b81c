"""Observations that nothing controls, as a table: of all kinds, from the covariances at hand."""

from __future__ import annotations

import numpy as np

from aatri.adapters.bundle.adjusted_observations import WIDTH
from aatri.adapters.solution import stacked
from aatri.adjusting.adjusted_observations import AdjustedObservations
from aatri.adjustment.statistics.uncontrolled import BELOW, uncontrolled_directions
from aatri.arrays import Float, Int
from aatri.artifacts.uncontrolled import Uncontrolled
from aatri.observations.poses import FILM
from aatri.orientation.bundle.result import BundleResult

FILM_PRIOR = f"{FILM}_prior"


def uncontrolled_of(result: BundleResult) -> tuple[Uncontrolled | None, Uncontrolled]:
    """Observations in use with a direction whose redundancy number is below 0.01, and such corrections of the film.

    Parameters
    ----------
    result : BundleResult
        None without covariances.
    """
    known = [o for o in result.observations if not o.observed.exact and np.isfinite(o.covariance[o.used]).any()]
    if result.adjusted.down_weighted or not known:
        return None, Uncontrolled.empty()
    table = stacked([Uncontrolled.empty(), *map(_of_kind, known)])
    return table.take(table.kind != FILM_PRIOR), table.take(table.kind == FILM_PRIOR)


def _of_kind(found: AdjustedObservations) -> Uncontrolled:
    o = found.observed
    rows = found.rows[found.used[found.rows]]
    records, m = o.records, o.records.rows
    R = np.eye(m) - found.covariance[rows]
    observed = records.observed_components()[rows]
    if o.components:
        return _of_parameters(found, rows, R)
    some, least, direction = uncontrolled_directions(R, observed, records.whitener[rows])
    image, point = o.names(rows[some])
    wide = np.full((len(some), WIDTH), np.nan)
    wide[:, :m] = direction
    return _table(o.kind, o.row[rows[some]], image, point, least, wide)


def _of_parameters(found: AdjustedObservations, rows: Int, R: Float) -> Uncontrolled:
    """Of weighted parameters one by one: they have no common direction."""
    o = found.observed
    r = np.einsum("nii->ni", R)
    weighted = np.isfinite(o.sigmas()[rows])
    row, component = np.nonzero(weighted & (np.where(weighted, r, 1.0) < BELOW))
    image, _ = o.names(rows[row])
    label = np.array(o.components, dtype=np.str_)[component]
    nothing = np.full((len(row), WIDTH), np.nan)
    return _table(o.kind, o.row[rows[row]], image, label, r[row, component], nothing)


def _table(kind: str, row: Int, image: np.ndarray, point: np.ndarray, least: Float, direction: Float) -> Uncontrolled:
    return Uncontrolled(np.full(len(row), kind), row.astype(np.int32), image, point, least, direction)
