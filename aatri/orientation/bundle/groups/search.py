"""The search for gross errors with groups before single observations.

1. Adjust by least squares. Where something is above the limit, and a group explains more than any single observation
   does, the group is carried as unknowns (`as_unknowns`), and the block adjusted again: it is accepted if that takes
   half of the squares of what is above the limit, that of a camera also if it takes as much of all squares; of several
   the one that leaves the least v'v, or a simpler one that leaves no more than `SEPARABLE` above it, the others named
   beside it; none where the single observation that explains most leaves as little (`single_errors`). Several positions
   or control points that an earlier stage has rejected take part: they may be a group, or agree with all else where
   one is carried, or self-calibration estimates what that stage lacked. Control with full covariances that it has
   rejected is carried from the beginning.
2. Search for single gross errors, the groups being carried.
3. Groups of what is left (`score_tests`), which single ones had hidden: with each the search begins anew. A group that
   is not significant in the end - single errors explain it, or standard deviations that fit - is none.
4. Adjust once more without the unknowns of the groups. Positions and attitudes of a group whose shift is beyond the
   limit are left out, all of them, where the block is determined without; a mark stays free of its frame, which is
   used without it; every other group is kept, all of it.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from aatri.adjustment.statistics.limits import SEPARABLE
from aatri.arrays import Float
from aatri.errors import ConvergenceError, GeometryError
from aatri.notes import Note
from aatri.observations.image_points import KIND as IMAGE_POINT
from aatri.observations.observed import Observed
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.blunders.all_records import AllRecords
from aatri.orientation.bundle.blunders.limits import MUCH_LESS
from aatri.orientation.bundle.blunders.robust import Adjust, AdjustOptions
from aatri.orientation.bundle.blunders.search_options import SearchOptions
from aatri.orientation.bundle.blunders.tested_block import misfit, tests_in_use, tests_of
from aatri.orientation.bundle.groups.as_unknowns import name_of, with_groups, without_groups
from aatri.orientation.bundle.groups.candidates import MARK, CandidatesOf
from aatri.orientation.bundle.groups.frame_marks import SETS_OUT, rejected_points_of_sets, without_rejected_sets
from aatri.orientation.bundle.groups.group import Group, with_harm
from aatri.orientation.bundle.groups.limits import MOST_GROUPS, ROUGH_SQUARES, SEVERAL
from aatri.orientation.bundle.groups.score_tests import at_result, is_significant, significant_groups
from aatri.orientation.bundle.groups.single_errors import attempted, beyond_exact, cost_without_worst, largest_gain_root
from aatri.orientation.bundle.result import BundleResult, from_result
from aatri.orientation.bundle.rounds import AdjustedBlock

Single = Callable[[BundleInput, list[BundleResult] | None], AdjustedBlock]

MOST_LINEARISED, LINEAR = 8, 0.1
"""Adjustments until the effect of a group at measured coordinates stays, and the change of it, in standard deviations,
that is none: c wrong by a quarter leaves residuals of which a quarter is wrong in the next."""


@dataclass(frozen=True)
class AcceptedGroup:
    """A group that is wrong by the search, and whether it was left out."""

    group: Group
    left_out: bool


def search_with_groups(
    block: BundleInput, adjust: Adjust, single: Single, candidates_of: CandidatesOf, options: SearchOptions
) -> tuple[AdjustedBlock, tuple[AcceptedGroup, ...]]:
    """Adjust a block, find groups that are wrong together, and leave out single gross errors.

    Parameters
    ----------
    single : callable
        (block, its least squares where they are known, to be taken out: they are as large as what follows) -> the block
        adjusted by `options`, searching for single gross errors.
    candidates_of : callable
        What is to be tested of a block.
    options : SearchOptions
        With `none` nothing is left out, and groups are told.

    Raises
    ------
    GeometryError, ConvergenceError
        If the block cannot be adjusted.
    """
    options = options.for_tests(AllRecords.of(block).tests)
    groups, least_squares = list[Group](), None
    carried = rejected_points_of_sets(block) if any(o.rejected_in_set is not None for o in block.observed) else []
    if options.method != "none":
        for taken_back in _rejected_before(block.observed):
            observed = tuple(o.again() if _several(o, taken_back) else o for o in block.observed)
            with_earlier = replace(block, observed=observed)
            groups, least_squares = _groups_before_single_errors(with_earlier, adjust, candidates_of, options, carried)
            of_images = taken_back == POSE and len(groups) > len(carried)
            if of_images or _agree(block, least_squares, options.w_limit, taken_back):
                block = with_earlier
                break
        else:
            groups, least_squares = _groups_before_single_errors(block, adjust, candidates_of, options, carried)
    taken_out = [] if least_squares is None else [least_squares]
    del least_squares
    done = _carried(block, groups, single, taken_out)
    if done is None and carried:
        groups, done = list(carried), _adjusted_with_groups(block, carried, single)
    if done is None:
        groups, done = [], single(replace(block, observed=without_rejected_sets(block.observed)), None)
        if carried:
            done = replace(done, notes=(*done.notes, Note("warning", SETS_OUT)))
    while len(groups) < MOST_GROUPS + len(carried):
        gain_root = largest_gain_root(done.result) if tests_in_use(done.result).max() > options.w_limit else 0.0
        candidates = significant_groups(block, done.result, candidates_of, gain_root, groups)
        if candidates:
            candidates = beyond_exact(block, done.result, adjust, groups, candidates)
        trials = ((group, _carried(block, [*groups, group], single)) for group in candidates)
        accepted = next(((group, adjusted) for group, adjusted in trials if adjusted is not None), None)
        if accepted is None:
            break
        groups.append(accepted[0])
        done = accepted[1]
    significant = [g for k, g in enumerate(groups) if is_significant(*_estimate(k, done.result))]
    if len(significant) < len(groups):
        reduced = _adjusted_with_groups(from_result(block, done.result), significant, single)
        groups, done = (groups, done) if reduced is None else (significant, reduced)
    if not groups:
        return done, ()
    return _without_group_unknowns(block, done, groups, adjust, options)


def _estimate(number: int, result: BundleResult) -> tuple[Float, Float]:
    """Parameters of a group that is carried, and their covariance, a posteriori where sigma0 is above 1."""
    name = name_of(number)
    return result.adjusted.state[name][0], result.covariances[name][0] * max(1.0, result.adjusted.sigma0) ** 2


def _rejected_before(observed: Sequence[Observed]) -> list[str]:
    """Of what an earlier stage has rejected several: control (POINT), positions and attitudes (POSE).

    One by one they are rejected, too, where all heights of the control are in another unit, or something else is wrong
    with a strip: the principal distance of its camera.
    """
    return [touched for touched in (POINT, POSE) if any(_several(o, touched) for o in observed)]


def _several(o: Observed, touched: str) -> bool:
    """Whether several of a kind that is observed of points alone, or of images alone, have been rejected."""
    groups = {group for group, _ in o.records.touches} & {POINT, POSE}
    return o.rejected is not None and groups == {touched} and not o.exact and int(o.rejected.sum()) >= SEVERAL


def _agree(block: BundleInput, least_squares: BundleResult | None, limit: float, touched: str) -> bool:
    """Whether what an earlier stage has rejected of a block agrees with all else in least squares with it.

    Heights of positions contradict the height that a wrong principal distance gives; where it is estimated they agree.
    """
    if least_squares is None:
        return False
    limit *= max(1.0, least_squares.adjusted.sigma0)
    for adjusted, before in zip(least_squares.observations, block.observed):
        if _several(before, touched):
            blocks, tests = dict(before.records.touches)[touched], tests_of(adjusted, least_squares.adjusted.state)
            untested = np.isin(blocks, np.flatnonzero(least_squares.set_aside.get(touched, [])))  # by these very ones
            if (untested | (tests > limit))[before.rejected].any():
                return False
    return True


def _carried(
    block: BundleInput, groups: list[Group], single: Single, least_squares: list[BundleResult] | None = None
) -> AdjustedBlock | None:
    """Single gross errors with groups carried; None where the block does not determine these."""
    return _adjusted_with_groups(block, groups, single, least_squares) if groups else single(block, least_squares)


def _adjusted_with_groups(
    block: BundleInput, groups: list[Group], single: Single, least_squares: list[BundleResult] | None = None
) -> AdjustedBlock | None:
    """The same; None where it cannot be adjusted."""
    try:
        return single(with_groups(block, groups), least_squares)
    except (ConvergenceError, GeometryError):
        return None


def _groups_before_single_errors(
    block: BundleInput, adjust: Adjust, candidates_of: CandidatesOf, options: SearchOptions, carried: list[Group]
) -> tuple[list[Group], BundleResult | None]:
    """Groups that explain what is above the limit better than single observations do; least squares with them."""
    groups, most = list(carried), MOST_GROUPS + len(carried)
    result = _squares(with_groups(block, groups) if groups else block, adjust, first=True)
    while result is not None and len(groups) < most:
        if tests_in_use(result).max() <= options.w_limit:
            break
        candidates = significant_groups(block, result, candidates_of, largest_gain_root(result), groups)
        trials = [_adjusted_with(block, adjust, candidates_of, groups, g) for g in candidates]
        fits = [(g, r) for g, r in trials if r is not None and _explains_most(g, r, result, options.w_limit)]
        if not fits:
            break
        least_cost = min(r.adjusted.cost for _, r in fits)
        tolerance = ROUGH_SQUARES + SEPARABLE * max(1.0, least_cost / max(result.adjusted.redundancy, 1))
        if cost_without_worst(with_groups(block, groups), result, adjust) <= least_cost + tolerance:
            break
        equivalent = [(g, r) for g, r in fits if r.adjusted.cost <= least_cost + tolerance]
        equivalent.sort(key=lambda trial: trial[0].complexity)
        group, result = equivalent[0]
        groups.append(_with_equivalents(group, [g for g, _ in equivalent]))
    return groups, result


def _with_equivalents(group: Group, equivalent: list[Group]) -> Group:
    """The group with what explains as much once it is adjusted, of each unit the simplest that comes first.

    The score tests before the adjustment need not show it: of a block far from the solution one step tells too little.
    """
    causes = {(g.place, g.per, g.unit): (g.per, g.unit, g.cause) for g in reversed(equivalent)}
    others = [cause for (place, per, _), cause in causes.items() if (place, per) != (group.place, group.per)]
    return replace(group, or_else=tuple(dict.fromkeys([*others, *group.or_else])))


def _explains_most(group: Group, result: BundleResult, before: BundleResult, limit: float) -> bool:
    """Whether half of the squares above the limit are gone, or of a camera as much of all: a lens is in every ray."""
    squares = MUCH_LESS * misfit(before, limit)
    of_all = group.per == "camera" and before.adjusted.cost - result.adjusted.cost >= squares
    return of_all or misfit(result, limit) <= squares


def _adjusted_with(
    block: BundleInput, adjust: Adjust, candidates_of: CandidatesOf, groups: list[Group], group: Group
) -> tuple[Group, BundleResult | None]:
    """Least squares with one more group, whose effect is taken where the adjustment with it leads, until it stays."""
    result = _squares(with_groups(block, [*groups, group]), adjust)
    depends_on_result = group.per == MARK or (group.kind == IMAGE_POINT and not group.removable)
    for _ in range(MOST_LINEARISED if depends_on_result else 0):
        if result is None:
            break
        value, sigma = result.adjusted.state[name_of(len(groups))][0], block.observed[group.place].sigmas()[group.rows]
        previous, group = group, replace(at_result(block, candidates_of, group, result), value=value)
        moved = np.abs((group.H - previous.H) @ value) / sigma
        result = _squares(with_groups(from_result(block, result), [*groups, group]), adjust)
        if np.nanmax(moved, initial=0.0) <= LINEAR:
            break
    return group, result


def _squares(block: BundleInput, adjust: Adjust, *, first: bool = False) -> BundleResult | None:
    """Least squares with everything; None where that fails. The first are the result where nothing is rejected."""
    return attempted(lambda: adjust(block, AdjustOptions(coarse=True, to_end_if_near=first)))


def _without_group_unknowns(
    block: BundleInput, done: AdjustedBlock, groups: list[Group], adjust: Adjust, options: SearchOptions
) -> tuple[AdjustedBlock, tuple[AcceptedGroup, ...]]:
    """The block adjusted without the unknowns of the groups."""
    without_unknowns = without_groups(block, groups, done.inputs)
    left_out = options.method != "none"
    limit = options.w_limit * max(1.0, done.result.adjusted.sigma0)
    removable = [g for g in groups if left_out and g.removable and _exceeds_limit(g, block, limit)]
    marks = [g for g in groups if left_out and g.per == MARK]
    for left_out_groups in (removable, []):
        inputs = with_groups(
            _without(without_unknowns, left_out_groups), marks, [f"{MARK} {g.kind} {g.unit}" for g in marks]
        )
        try:
            result = adjust(inputs, AdjustOptions())
        except GeometryError:
            if not left_out_groups:
                raise
            continue
        break
    out = [any(g is o for o in (*left_out_groups, *marks)) for g in groups]
    estimated = [_with_estimate(g, k, done.result) for k, g in enumerate(groups)]
    judged = with_harm(block, result, estimated, out)
    return replace(done, inputs=inputs, result=result), tuple(map(AcceptedGroup, judged, out))


def _with_estimate(group: Group, number: int, result: BundleResult) -> Group:
    """The group with the values of the adjustment that carried it."""
    value, covariance = _estimate(number, result)
    return replace(group, value=value, sigma=np.sqrt(np.diagonal(covariance)), sigma0=result.adjusted.sigma0)


def _exceeds_limit(group: Group, block: BundleInput, limit: float) -> bool:
    """Whether a single observation with this error would be rejected, and as few would go beside it undecided."""
    if len(group.undecided) > len(group.rows):
        return False
    sigma = block.observed[group.place].sigmas()[group.rows]
    return bool((np.isfinite(sigma) & (np.abs(group.effect) > limit * sigma)).any())


def _without(block: BundleInput, groups: list[Group]) -> BundleInput:
    observed = list(block.observed)
    for g in groups:
        o = observed[g.place]
        rejected = np.zeros(len(o), dtype=bool) if o.rejected is None else o.rejected.copy()
        rejected[np.concatenate([g.rows, g.undecided])] = True  # where nothing tells which it is, all go
        observed[g.place] = o.again().without(rejected)
    return replace(block, observed=tuple(observed))
