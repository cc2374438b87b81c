"""Suspects of a bundle: what it rejects itself, what of earlier rejections it sees, what a robust one would reject.

The test statistic of a robust bundle is the length of the residual in a-priori standard deviations. It is not
standardised by a redundancy number, which a robust adjustment does not have: the next bundle re-admits what fits.
"""

from collections import Counter
from dataclasses import replace

import numpy as np

from aatri.adapters.observation_tables import suspect_table
from aatri.adapters.solution import stacked
from aatri.adjusting.adjusted_observations import AdjustedObservations
from aatri.adjustment.records import whitened_residuals
from aatri.adjustment.statistics.limits import SHARE_REJECTED
from aatri.adjustment.statistics.record_tests import record_tests
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int, Text
from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.artifacts.suspects import Suspects
from aatri.notes import Note
from aatri.observations.control import KIND as CONTROL
from aatri.observations.control import control_of
from aatri.observations.observed import Observed, named
from aatri.observations.poses import POINT
from aatri.observations.positions import KIND as POSITION
from aatri.observations.positions import positions_of
from aatri.orientation.bundle.blunders.search_options import SearchOptions
from aatri.orientation.bundle.blunders.tested_block import tests_of
from aatri.orientation.bundle.groups.candidates import MARK
from aatri.orientation.bundle.groups.frame_marks import gives_coordinates
from aatri.orientation.bundle.result import BundleResult
from aatri.orientation.bundle.rounds import AdjustedBlock, keys_of, with_keys

STAGE = "bundle_adjustment"
STAYS_OUT = "stays out unless it fits the adjusted block"


def _beyond_the_limit(result: BundleResult, options: SearchOptions) -> list[Suspects]:
    """Observations of all kinds whose residual in a robust adjustment is beyond the limit."""
    tested = [o for o in result.observations if not (o.observed.exact or o.observed.components) and o.used.any()]
    tests = sum(int(o.observed.records.observed_components()[o.used].sum()) for o in tested)
    limit, parts = options.for_tests(tests).w_limit, []
    for adjusted in tested:
        rows = np.flatnonzero(adjusted.used)
        w = whitened_residuals(adjusted.observed.records, result.adjusted.state, rows)
        test = np.sqrt((w**2).sum(axis=1))
        far = rows[test > limit]
        error = -adjusted.observed.records.evaluate(result.adjusted.state, far)[0]
        verdict = np.full(len(far), "rejected")
        parts.append(suspect_table(STAGE, adjusted.observed, far, error, test[test > limit], verdict))
    return parts


def after(suspects: Suspects, done: AdjustedBlock, options: SearchOptions | None = None) -> Suspects:
    """The suspects after an adjustment: those of earlier stages as it sees them, and what it rejected itself.

    What is out, whoever found it, gets the gross error that the adjusted block predicts, component by component, with
    its test; of a kind that the block does not adjust (ties of models) it keeps what the earlier stage said. A robust
    adjustment, by the options of the search, names what is beyond the limit.
    """
    stated = done.inputs
    before = set(zip(suspects.kind.tolist(), suspects.row.tolist()))
    out = {key for o in stated.observed if o.rejected is not None for key in keys_of(o, o.rejected)}
    of_adjusted_kind = np.isin(suspects.kind, [o.kind for o in stated.observed]) & (suspects.row >= 0)
    of_sets = _out_of_sets(done)
    used = np.zeros(len(suspects), dtype=bool)  # an image point outside the format is not, though nothing rejects it
    for adjusted in done.result.observations:
        o = adjusted.observed
        rows_used = o.row[adjusted.used] if o.set_rows is None else o.set_rows[adjusted.used]
        used |= (suspects.kind == o.kind) & np.isin(suspects.row, rows_used)
    out_of_set = (suspects.kind == CONTROL) & np.isin(suspects.row, of_sets.row)
    used &= ~out_of_set
    rejected = np.array([key in out for key in zip(suspects.kind.tolist(), suspects.row.tolist())], dtype=bool)
    back = of_adjusted_kind & used & ~rejected & suspects.staying_out
    restated, parts = replace(suspects, verdict=np.where(back, "readmitted", suspects.verdict)), []
    restated = replace(restated, verdict=np.where(out_of_set, "rejected", restated.verdict))
    restated = _restated(restated, np.flatnonzero(suspects.kind == CONTROL), of_sets)
    listed_before = [(CONTROL, row) in before for row in of_sets.row.tolist()]
    parts.append(of_sets.take(~np.array(listed_before, dtype=bool)))
    for adjusted in done.result.observations:
        o = adjusted.observed
        if o.components:
            continue
        rejected_rows = np.zeros(len(o), dtype=bool) if o.rejected is None else o.rejected
        # a kind may be several, as distances between points and from images are
        of_part = np.isin(suspects.row, o.row if o.set_rows is None else o.set_rows)
        earlier = np.flatnonzero(of_adjusted_kind & (suspects.kind == o.kind) & of_part)
        listed = with_keys(o, [(o.kind, int(row)) for row in suspects.row[earlier]])
        rows = np.flatnonzero(rejected_rows | listed | with_keys(o, done.above))
        if not len(rows):
            continue
        error, test = _errors(adjusted, done.result.adjusted.state, rows)
        rows_stated = suspect_table(STAGE, o, rows, error, test, _verdicts(done, o, rows))
        restated = _restated(_with_verdicts(restated, earlier[rejected[earlier]], rows_stated), earlier, rows_stated)
        parts.append(rows_stated.take([key not in before for key in keys_of(o, rows)]))
    if options is not None and options.method == "robust":
        parts += _beyond_the_limit(done.result, options)
    return stacked([restated, *parts])


def _out_of_sets(done: AdjustedBlock) -> Suspects:
    """Control points with full covariances that are carried as unknowns, which is to use the others without them."""
    state, ids, parts = done.result.adjusted.state, np.asarray(done.inputs.point_ids), list[Suspects]()
    for o in (adjusted.observed for adjusted in done.result.observations):
        of_mark = f"{MARK} {o.kind} "
        carried = {name.removeprefix(of_mark): name for name, _ in o.records.touches if name.startswith(of_mark)}
        of_points = [points for group, points in o.records.touches if group == POINT]
        if o.set_rows is None or not gives_coordinates(o):
            continue
        for j, points in enumerate(of_points):
            for row in np.flatnonzero(np.isin(ids[points], list(carried))).tolist():
                point = str(ids[points[row]])
                value, covariance = state[carried[point]][0], done.result.covariances[carried[point]][0]
                error = np.full((1, 3), np.nan)
                error[0, o.records.observed_components()[row, 3 * j : 3 * j + 3]] = value
                test = np.sqrt([value @ np.linalg.solve(covariance, value)])
                single = replace(o, row=o.set_rows[row, j : j + 1], names=named(point=np.array([point])))
                parts.append(suspect_table(STAGE, single, np.array([0]), error, test, np.array(["rejected"])))
    return stacked([Suspects.empty(), *parts])


def _errors(adjusted: AdjustedObservations, state: State, rows: Int) -> tuple[Float, Float]:
    """Estimated gross errors of some observations, (k, m), and their tests; NaN where nothing predicts them."""
    o, m = adjusted.observed, adjusted.observed.records.rows
    records = o.records.take(rows)
    tests = record_tests(
        records, state, adjusted.covariance[rows], whitened_residuals(records, state, np.arange(len(rows)))
    )
    L = records.whitener if records.whitener.ndim == 3 else records.whitener[:, :, None] * np.eye(m)
    error = np.einsum("nij,nj->ni", np.linalg.pinv(L), np.nan_to_num(tests.size))
    error = np.where(records.observed_components() & np.isfinite(tests.test)[:, None], error, np.nan)
    bare = ~np.isfinite(adjusted.covariance[rows]).all(axis=(1, 2)) & np.isin(rows, adjusted.rows)
    if bare.any():  # adjusted without standard deviations: what is out is predicted all the same
        error[bare] = -o.records.evaluate(state, rows[bare])[0]
    return error, tests_of(adjusted, state)[rows]


def _with_verdicts(suspects: Suspects, out: Int, later: Suspects) -> Suspects:
    """Suspects of earlier stages that are out now, with the verdict of this adjustment, unless it tells nothing."""
    at = {int(row): k for k, row in enumerate(later.row.tolist())}
    verdict = suspects.verdict.astype(np.result_type(suspects.verdict, later.verdict))
    for k in out.tolist():
        place = at[int(suspects.row[k])]
        if np.isfinite(later.test[place]) or later.verdict[place] != "rejected" or not suspects.staying_out[k]:
            verdict[k] = later.verdict[place]
    return replace(suspects, verdict=verdict)


def _restated(suspects: Suspects, earlier: Int, later: Suspects) -> Suspects:
    """Suspects of earlier stages with the sizes of this adjustment, where it knows them."""
    at = {int(row): k for k, row in enumerate(later.row.tolist()) if np.isfinite(later.size[k])}
    rows = np.array([k for k in earlier.tolist() if int(suspects.row[k]) in at], dtype=np.int64)
    if not len(rows):
        return suspects
    new = later.take([at[int(row)] for row in suspects.row[rows]])
    values = {name: getattr(suspects, name).copy() for name in ("size", "sigma", "test", "error")}
    for name, column in values.items():
        column[rows] = getattr(new, name)
    unit = suspects.unit.astype(np.result_type(suspects.unit, new.unit))
    unit[rows] = new.unit
    return replace(suspects, unit=unit, **values)


def inherited(
    block: Block, initial: Solution | None, *, taken_back: bool = False, groups_back: bool = True
) -> tuple[Suspects, list[Note]]:
    """Suspects of earlier stages, and notes of what they have left out.

    Control of points, or positions of images, that `initial` places and of which earlier stages have left out all are
    used again: they are wrong together, or what they were held against is, and that is for the tests of groups.

    Parameters
    ----------
    taken_back : bool
        What was left out is used again; ties of models stay as they were made.
    groups_back : bool
        Control or positions that were all left out are used again; else they stay out.
    """
    if initial is None:
        return Suspects.empty(), []
    suspects, notes = initial.suspects, []
    staying, of_block = suspects.staying_out, suspects.row >= 0
    tested_again = (CONTROL, POSITION) if groups_back and not taken_back else ()
    all_out = [kind for kind in tested_again if _all_left_out(block, initial, staying, kind)]
    of_others = "taken back, for nothing is to be rejected" if taken_back else STAYS_OUT
    for kinds, what in (
        (all_out, "all of their kind, taken back to be tested as a group"),
        (np.setdiff1d(suspects.kind, all_out), of_others),
    ):
        rows = staying & np.isin(suspects.kind, kinds)
        counts = Counter(zip(suspects.kind[rows].tolist(), suspects.stage[rows].tolist()))
        texts = tuple(f"{n} {kind} ({stage})" for (kind, stage), n in sorted(counts.items()))
        notes += [Note("note", f"left out by earlier stages, {what}", texts)] if texts else []
    back = staying & of_block & (np.bool_(taken_back) | np.isin(suspects.kind, all_out))
    return replace(suspects, verdict=np.where(back, "readmitted", suspects.verdict)), notes


def _all_left_out(block: Block, solution: Solution, staying: Bool, kind: str) -> bool:
    """Whether all observations of a kind that could take part are rejected, and several; not two exchanged points.

    A stage that does not adjust a kind has no residuals of it: the block tells what could take part.
    """
    suspects = solution.suspects.take(staying & (solution.suspects.kind == kind))
    error = np.nan_to_num(suspects.error)
    sizes = np.linalg.norm(error, axis=1)
    if kind == CONTROL and len(error) == 2 and np.linalg.norm(error.sum(axis=0)) < SHARE_REJECTED * sizes.min():
        return False  # each is off by the way to the other
    if kind == CONTROL:
        of_block = control_of(block)
        row = of_block.row[np.isfinite(solution.points.xyz_m[of_block.point]).any(axis=1)]
    else:
        positions = positions_of(block)
        row = positions.row[solution.images.oriented[positions.image]]
    return len(suspects) > 1 and len(row) > 0 and bool(np.isin(row, suspects.row).all())


def _verdicts(done: AdjustedBlock, o: Observed, rows: Int) -> Text:
    """Rejected, undecidable, swapped or kept."""
    swapped, undecided, above = (
        with_keys(o, keys)[rows]
        for keys in ([key for pair in done.swapped for key in pair], done.undecided, done.above)
    )
    verdict = np.where(undecided, "undecidable", np.where(above, "kept", "rejected"))
    return np.where(swapped, "swapped", verdict)
