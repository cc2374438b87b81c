"""Image points with gross errors, as a robust bundle shows them: suspects for the least-squares bundle that follows.

The test statistic is the length of the residual in a-priori standard deviations. It is not standardised by a redundancy
number, which a robust adjustment does not have: the limit is to be generous, and the next bundle re-admits what fits.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aatri.adapters import solution as assemble
from aatri.arrays import Bool, Int, Text
from aatri.artifacts.suspects import Suspects, staying_out
from aatri.orientation.bundle.blunders.tested import tests_of
from aatri.orientation.bundle.result import BundleResult
from aatri.orientation.bundle.rounds import Round


def with_gross_errors(result: BundleResult, suspects: Suspects, limit: float) -> Suspects:
    """The suspects and the image points whose residual is longer than `limit` standard deviations."""
    found = next(o for o in result.observations if o.observed.kind == "image_point")
    rows = np.flatnonzero(found.used)
    records = found.observed.records
    v, sigma = records.evaluate(result.adjusted.state, rows)[0], found.observed.sigmas()[rows]
    test = np.sqrt(np.nansum((v / sigma) ** 2, axis=1))
    far = np.flatnonzero(test > limit)
    rows, n = rows[far], len(far)
    size = np.sqrt(np.nansum(v[far] ** 2, axis=1))
    image, point = found.observed.names(rows)
    new = Suspects(
        kind=np.full(n, "image_point"),
        row=rows.astype(np.int32),
        image=image,
        point=point,
        stage=np.full(n, "bundle_adjustment"),
        size=size,
        unit=np.full(n, "mm"),
        sigma=size / test[far],
        test=test[far],
        verdict=np.full(n, "rejected"),
    )
    return assemble.stacked([suspects, new])


def after(suspects: Suspects, done: Round) -> Suspects:
    """The suspects after an adjustment: those of earlier stages with their verdict, and what it rejected itself."""
    given, result = done.given, done.result
    state = result.adjusted.state
    parts, before = [], set(zip(suspects.kind.tolist(), suspects.row.tolist()))
    out = {(o.kind, int(r)) for o in given.observed if o.rejected is not None for r in o.row[o.rejected]}
    known = [pair in out for pair in zip(suspects.kind.tolist(), suspects.row.tolist())]
    tested = np.isin(suspects.kind, [o.kind for o in given.observed]) & (suspects.row >= 0)
    back = tested & ~np.array(known, dtype=bool) & staying_out(suspects)
    verdict = np.where(back, "readmitted", suspects.verdict)
    for i, found in enumerate(result.observations):
        o = found.observed
        if o.components:
            continue
        told = np.zeros(len(o), dtype=bool) if o.rejected is None else o.rejected
        rows = np.flatnonzero(told | _kept(done, i))
        rows = rows[[(o.kind, int(r)) not in before for r in o.row[rows]]] if len(rows) else rows
        if not len(rows):
            continue
        test = tests_of(found, state)
        predicted = np.isin(rows, found.rows)
        v = np.full((len(rows), o.records.rows), np.nan)
        v[predicted] = o.records.evaluate(state, rows[predicted])[0]
        size = np.where(predicted, np.sqrt(np.nansum(v**2, axis=1)), np.nan)
        image, point = o.names(rows)
        n, w = len(rows), test[rows]
        parts.append(
            Suspects(
                kind=np.full(n, o.kind),
                row=o.row[rows].astype(np.int32),
                image=image,
                point=point,
                stage=np.full(n, "bundle_adjustment"),
                size=size,
                unit=np.full(n, o.unit),
                sigma=np.where(w > 0, size / np.where(w > 0, w, 1.0), np.nan),
                test=w,
                verdict=_verdicts(done, i, rows),
            )
        )
    return assemble.stacked([replace(suspects, verdict=verdict), *parts])


def _verdicts(done: Round, place: int, rows: Int) -> Text:
    """Rejected, undecidable or swapped."""
    swapped = [r for swap in done.swapped if swap.place == place for r in (swap.first, swap.second)]
    undecided = done.undecided[place][rows] if done.undecided else np.zeros(len(rows), dtype=bool)
    verdict = np.where(undecided, "undecidable", np.where(_kept(done, place)[rows], "kept", "rejected"))
    return np.where(np.isin(rows, swapped), "swapped", verdict)


def _kept(done: Round, place: int) -> Bool:
    return done.above[place] if done.above else np.zeros(len(done.result.observations[place].observed), dtype=bool)
