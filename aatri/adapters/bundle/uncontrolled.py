"""Observations that nothing controls, as a table and as notes: of all kinds, from the covariances at hand.

What is known beforehand of the film of single images (its shift, say, which a station takes up) is often known by that
alone, in image after image: such are counted in a note and not listed.
"""

from __future__ import annotations

import numpy as np

from aatri.adapters.bundle.adjusted_observations import WIDTH
from aatri.adapters.solution import stacked
from aatri.adjusting.adjusted_observations import AdjustedObservations
from aatri.adjustment.statistics.uncontrolled import BELOW, uncontrolled_directions
from aatri.arrays import Float, Int
from aatri.artifacts.uncontrolled import Uncontrolled
from aatri.notes import Note
from aatri.observations.image_points import KIND
from aatri.observations.poses import FILM
from aatri.orientation.bundle.result import BundleResult

FILM_PRIOR = f"{FILM}_prior"


def uncontrolled_of(result: BundleResult) -> tuple[Uncontrolled | None, list[Note]]:
    """Observations in use with a direction whose redundancy number is below 0.01, and what is to be said of them.

    Parameters
    ----------
    result : BundleResult
        None without covariances.
    """
    if result.adjusted.down_weighted:
        return None, []
    known = [o for o in result.observations if not o.observed.exact and np.isfinite(o.covariance[o.used]).any()]
    if not known:
        return None, []
    found = stacked([Uncontrolled.empty(), *map(_of_kind, known)])
    of_film = found.kind == FILM_PRIOR
    table = found.take(~of_film)
    notes = _notes(table)
    if of_film.any():
        images = len(np.unique(found.image[of_film]))
        labels = ", ".join(np.unique(found.point[of_film]).tolist())
        text = f"{FILM_PRIOR}: {int(of_film.sum())} corrections of the film of {images} images ({labels}) are known "
        notes.append(Note("note", text + "from the interior orientation alone; not listed in `uncontrolled`"))
    return table, notes


def _notes(table: Uncontrolled) -> list[Note]:
    """How many of each kind, and which; of image points the points."""
    notes = []
    for kind in np.unique(table.kind):
        mine = table.take(table.kind == kind)
        if kind == KIND:
            points = np.unique(mine.point)
            what = f"{len(mine)} at {len(points)} points, mostly of two rays, have"
            ids = tuple(points.tolist())
        else:
            what = f"{len(mine)} {'has' if len(mine) == 1 else 'have'}"
            ids = tuple("/".join(x for x in pair if x) for pair in zip(mine.image.tolist(), mine.point.tolist()))
        text = f"{kind}: {what} a direction that nothing controls (redundancy number below {BELOW:g}): a gross error "
        notes.append(Note("note", text + "along it shows nowhere (table `uncontrolled`)", ids))
    return notes


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
