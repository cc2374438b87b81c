"""What an adjusted block has to say: what was left out, what was weighted down, whether sigma0 fits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aatri.adjusting.adjusted_observations import AdjustedObservations
from aatri.adjustment.statistics.global_test import global_test, refuse_misfit, sigma0_note
from aatri.adjustment.unknowns import State
from aatri.notes import Note
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bundle.block import BundleInput, touched_points
from aatri.orientation.bundle.result import BundleResult

WHICH = "`variance_components: {groups: [kind]}` estimates those of each kind of observation"
"""Told where sigma0 does not fit."""


def left_out(given: BundleInput, result: BundleResult) -> list[Note]:
    """Images, points and observations that do not take part, by name.

    Image points go with their image or point; observations of points that nothing ties to the block are only noted.
    """
    notes = []
    told = result.set_aside
    images = np.asarray(given.image_ids)[~result.image_adjusted & ~told.get(POSE, np.False_)]
    tied = touched_points(given) & ~told.get(POINT, np.False_)
    points = np.asarray(given.point_ids)[tied & ~result.point_adjusted]
    for ids, of, what, why in (
        (points, len(given.point_ids), "points", "too few usable rays"),
        (images, len(given.image_ids), "images", "no start or too few points"),
    ):
        if len(ids):
            notes.append(Note("warning", f"left out, {why} ({len(ids)} of {of} {what})", tuple(ids.tolist())))
    for o in result.observations:
        notes += _unused(o, given)
    return [*notes, *_idle(given, result)]


def _idle(given: BundleInput, result: BundleResult) -> list[Note]:
    """Cameras, drift groups ... that are to be estimated, and that no observation in use touches."""
    notes, adjusted = [], {u.name: u.free for u in result.adjusted.problem.unknowns}
    for u in (u for o in given.observed for u in o.unknowns if not u.joins):
        idle = u.free.any(axis=1) & ~adjusted[u.name].any(axis=1)
        if idle.any() and not (u.free & ~adjusted[u.name])[~idle].any():
            ids = tuple(np.asarray(u.ids, dtype=np.str_)[idle].tolist())
            notes.append(Note("warning", f"not estimated, nothing in use observes them ({u.name})", ids))
    return notes


def remarks(given: BundleInput, state: State, *, before: bool) -> list[Note]:
    """What kinds of observations say of orientations: those of `initial` before the adjustment, the adjusted after."""
    return [note for o in given.observed if o.remarks is not None for note in o.remarks(state, before)]


def _unused(found: AdjustedObservations, given: BundleInput) -> list[Note]:
    """Observations in use on input that touch nothing that takes part; image points are told by image and point."""
    o = found.observed
    unused = o.records.active.copy()
    unused[found.rows] = False
    rows = np.flatnonzero(unused)
    if not len(rows) or o.components or (given.rays is not None and len(o) == len(given.rays.image)):
        return []
    image, point = o.names(rows)
    ids = tuple(a or b for a, b in zip(image.tolist(), point.tolist()))
    alone = len(o.records.touches) == 1 and o.records.touches[0][0] == POINT
    if alone and not touched_points(given)[o.records.touches[0][1][rows]].any():
        return [Note("note", f"{o.kind}: nothing else is measured at {len(rows)} of {len(o)}", ids)]
    return [Note("warning", f"{o.kind}: {len(rows)} of {len(o)} are not used, what they touch is left out", ids)]


def down_weighted(result: BundleResult, weighting: str, bound: float) -> list[Note]:
    """How many observations a robust adjustment has weighted down, and what it cannot give."""
    count, used = result.adjusted.down_weighted, sum(int(o.used.sum()) for o in result.observations)
    notes = [Note("note", f"{count} of {used} observations are weighted down ({weighting}, bound {bound:g} sigma)")]
    if count:
        text = (
            "not a least-squares solution: it has neither sigma0 nor standard deviations; a bundle with "
            "`blunders: robust_snooping` that starts from this one gives them"
        )
        notes.append(Note("warning", text))
    return notes


def misfit(result: BundleResult, max_sigma0: float) -> list[Note]:
    """sigma0 with its interval, and what finds the standard deviations where it does not fit.

    Raises
    ------
    ConvergenceError
        If sigma0 is beyond `max_sigma0`.
    """
    if result.adjusted.down_weighted:
        return []
    counted = result.adjusted.redundancy if result.counted is None else round(result.counted)
    test = global_test(result.adjusted.sigma0, counted)
    refuse_misfit(test, max_sigma0)
    note = sigma0_note(test)
    if note.level == "warning":
        note = replace(note, text=f"{note.text}; {WHICH}")
    return [note]
