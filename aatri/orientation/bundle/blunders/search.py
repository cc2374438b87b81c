"""The search for gross errors in a bundle: robust start, data snooping, re-admission; every kind takes part.

1. Adjust by least squares, with standard deviations that fit the residuals (`scaling`). Where no |w| is above the
   limit, which counts the tests made, that is the result; but points that rejections of earlier stages contradict are
   asked again, all records of each.
2. Else adjust once more, robustly: gross errors smear in least squares, hardly in a robust adjustment. With its poses,
   held, each point with something above the limit, or rejected by an earlier stage, is looked at (`points`): the
   fewest records are left out without which the others agree. Of other kinds what is above the limit goes.
3. Adjust by least squares without it; of what is above the limit the clearest goes, at points by all that touch them;
   then what fits the block after all comes back (`adjustment.statistics.search`); until nothing changes.
4. Exact coordinates are tested (`exact_coordinates`); without the worst the search goes on.
5. What is out of other kinds than rays is tried against the others of its kind (`attribution_in_kind`).

The limit counts the tests, and knows the tails of the errors (`fitted_sigmas`).

Records that nothing tells apart are both left out, and nobody is blamed (`adjustment.statistics.attribution`). No more
of a kind is rejected than its redundancy answers for (`adjustment.statistics.room`): where more disagrees single gross
errors explain nothing, and all of the kind stay. With a redundancy below `ESTIMABLE` large |w| may come of standard
deviations that are too small: only what stands out by the tau test too goes.

Source: Baarda 1968; Huber 1964; Foerstner 1983; docs/formulas.md 6.7, 7.3.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aatri.adjustment.statistics import search as statistics
from aatri.adjustment.statistics.rejection import overfull, room_left
from aatri.adjustment.statistics.room import room_of
from aatri.arrays import Bool
from aatri.errors import ConvergenceError, GeometryError
from aatri.notes import Note
from aatri.observations.poses import POSE
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.blunders.attribution_in_kind import attributed_in_kind, is_ray
from aatri.orientation.bundle.blunders.exact_coordinates import ExactCoordinates, Searched, exact_notes
from aatri.orientation.bundle.blunders.fitted_sigmas import HARMLESS, MOST_SCALINGS
from aatri.orientation.bundle.blunders.other_numbers import other_numbers
from aatri.orientation.bundle.blunders.points import well_intersected
from aatri.orientation.bundle.blunders.robust import Adjust, AdjustOptions, robust
from aatri.orientation.bundle.blunders.search_notes import SearchOutcome, findings
from aatri.orientation.bundle.blunders.search_options import SearchOptions
from aatri.orientation.bundle.blunders.swaps import Swap, exchanged_coordinates, swaps
from aatri.orientation.bundle.blunders.tested_block import TestedBlock, known_covariance, tests_of
from aatri.orientation.bundle.result import BundleResult, from_result
from aatri.orientation.bundle.rounds import AdjustedBlock, keys_of, with_readmission

UNTESTED = (
    "gross errors were not searched for: no observation has a test, for nothing controls it, or the block was solved "
    "without standard deviations"
)


def search(
    block: BundleInput,
    adjust: Adjust,
    options: SearchOptions,
    tolerance: float = 1e-3,
    squares: BundleResult | None = None,
) -> AdjustedBlock:
    """Adjust a block and leave out its gross errors.

    Parameters
    ----------
    block : BundleInput
        What earlier stages have rejected is not active, and may come back.
    adjust : callable
    options : SearchOptions
    tolerance : float
        Bound of the Newton decrement of the result.
    squares : BundleResult, optional
        Least squares with everything, where that is known.

    Raises
    ------
    GeometryError, ConvergenceError
        If the block cannot be adjusted, robustly neither.
    """
    return _Search(block, adjust, options, tolerance).run(squares)


class _Search(ExactCoordinates):
    """The steps of a search."""

    def __init__(self, block: BundleInput, adjust: Adjust, options: SearchOptions, tolerance: float) -> None:
        super().__init__(block, adjust, options)
        self.tolerance = tolerance
        self.whole = np.zeros(len(self.all.native), dtype=bool)

    def run(self, squares: BundleResult | None) -> AdjustedBlock:
        """Search."""
        active = self.began = self.all.native & ~self.all.rejected_in(self.block)
        first, failure = (self._tested(squares, active), None) if squares else self._first(active)
        if first is not None and not np.isfinite(first.test).any():
            plain = with_readmission(self.block, lambda block: self.adjust(block, AdjustOptions()))
            return replace(plain, notes=(*plain.notes, Note("warning", UNTESTED)))
        redundancy, count = self.all.redundancy(None if first is None else first.result)
        self.pool = replace(self.pool, room=room_of(redundancy, count, self.options.max_share))
        start = None if first is None else self._with_fitting_sigmas(first)
        if (again := self._rejected_with_smaller_sigmas(active)).any():
            active = self.began = active | again
            self.block = replace(self.block, observed=self.all.without(self.block.observed, active))
            start, failure = self._first(active)
            start = None if start is None else self._with_fitting_sigmas(start)
        harmful = start is None or ((self.smeared or self._harmful(start, active)) and not start.small)
        if self.options.method == "robust_snooping" and harmful:
            active = self._from_robust(active, start)
            start = self._with_fitting_sigmas(self.solve(None, active))
        elif start is None and failure is not None:
            raise failure
        else:
            assert start is not None
            start, active = self._asked_again(start, active)
        assert start is not None
        start = replace(start, tails=self._tails(start.result))
        (tried, use, swapped), wrong = self.without_wrong_exact(self.searched(start, active))
        exchanged = self._rows_of(swapped)
        turn = attributed_in_kind(tried, self.undecided & ~use, exchanged, self.all, self.adjust)
        tried, use = turn.tried, turn.tried.active
        gone = self.all.native & ~use
        undecided = gone & (self.undecided | turn.undecided | self._lost(tried.result, gone))
        asked = (tried.result, self.block.rays, self.all.split(gone), self.options.limit)
        renumbered = tuple(other_numbers(*asked, swapped))
        above = use & ((tried.plain if tried.small else tried.test) > self.options.limit)
        doubtful = above & self.at_doubtful
        doubted = use & self.kept & self.of_points(np.unique(self.all.point[doubtful]))
        above &= ~turn.kept & ~doubtful
        told = SearchOutcome(use, undecided, above, doubted, renumbered, tried.small, tried.plain, self.whole)
        notes = (
            *self.scaling.notes(of_result=self.options.sigmas == "estimated"),
            *self._tail_notes(use, tried.plain),
            *findings(tried.block, self.all, told, self.options),
            *exact_notes(self.all, wrong & use),
            *turn.notes,
        )
        pairs = tuple(keys_of(self.all.observed[s.place], np.array([s.first, s.second])) for s in swapped)
        return AdjustedBlock(
            *self._with_sigmas_of_the_result(tried),
            notes,
            self.all.keys(undecided),
            self.all.keys(above | doubtful | doubted | turn.kept | (wrong & use)),
            tuple((a, b) for a, b in pairs),
            renumbered,
            self.scaling.main_factor if self.options.sigmas == "estimated" else 1.0,
        )

    def _asked_again(self, start: TestedBlock, active: Bool) -> tuple[TestedBlock, Bool]:
        """Adjusted without what is wrong at the points that rays contradict which an earlier stage has rejected.

        What an earlier stage has left there may agree by itself and be wrong: two rays whose error lies along their
        base. All records of the point are held against each other, also those that are out.
        """
        rays = self.all.at_points & ~self.all.coordinates
        contradicted = self.all.native & rays & ~active & (start.test > self.options.limit)
        points = np.unique(self.all.point[contradicted])
        if not len(points):
            return start, active
        out = self.wrong_where_most_meet(start.result, points, active, start.test, start.tails)
        use = np.where(self.of_points(points), self.all.native & ~out, active)
        return (start, active) if (use == active).all() else (self.solve(None, use), use)

    def _rejected_with_smaller_sigmas(self, active: Bool) -> Bool:
        """What an earlier stage has rejected of classes whose standard deviations turned out too small, (n,)."""
        return self.all.native & ~active & (self._of_classes(self.scaling.factor) > 1.0)

    def searched(self, start: TestedBlock, active: Bool) -> Searched:
        """Search; exchanged numbers are explained: where they took up the room of a kind, search on without them."""
        first = start

        def solve(before: TestedBlock | None, use: Bool, _: float) -> TestedBlock:
            return self.solve(before or first, use)

        while True:
            found = statistics.search(solve, active, self.snooping, self.pool, self.next_rejections)
            tried, use = found.solved, found.active
            gone = self.all.split(self.all.native & ~use)
            swapped = tuple(swaps(tried.result, self.block.rays, gone, self.options.limit))
            explained = self._rows_of(swapped) & self.pool.counted
            above = use & (tried.test > self.options.limit)
            if explained.any() and above.any():
                self.pool = replace(self.pool, counted=self.pool.counted & ~explained)
                first, active = tried, use
                continue
            began = self.began & self.pool.counted
            full, back = overfull(self.snooping, self.pool, above & ~self.at_doubtful, use, began)
            assert self.pool.room is not None
            self.pool.room[full] = 0  # all of the kind come back, and nothing goes again
            back = back if back.any() else self._at_lost_points(tried, use)
            if not back.any():
                return tried, use, swapped
            first, active = tried, use | back

    def _rows_of(self, swapped: Sequence[Swap]) -> Bool:
        """What fits with each other's numbers, (n,)."""
        rows = [self.all.first[s.place] + row for s in swapped for row in (s.first, s.second)]
        return np.isin(np.arange(len(self.all.native)), rows)

    def _at_lost_points(self, tried: TestedBlock, use: Bool) -> Bool:
        """What nearly agrees at points that were lost with rejections of earlier stages, (n,): the block tests it."""
        out, rays, result = self.all.native & self.all.at_points & ~use, self.block.rays, tried.result
        points = np.unique(self.all.point[out])
        points = points[~result.point_adjusted[points] & (self.attributions[points] == 0)]
        if rays is None or not len(points):
            return np.zeros_like(use)
        xyz, poses = self.where_most_meet(result, points), result.adjusted.state[POSE]
        rays = replace(rays, active=rays.active & result.image_adjusted[rays.image])
        nothing, tails = np.zeros(len(points), dtype=bool), HARMLESS * tried.tails
        wrong = self.wrong_at_points(result, points, nothing, use, tried.test, tails, move=True, xyz_m=xyz)
        return out & self.of_points(well_intersected(rays, poses, xyz, points)) & ~wrong

    def _lost(self, result: BundleResult, gone: Bool) -> Bool:
        """Records of points that were lost with two of them and more: what is wrong there nobody can tell."""
        point = np.maximum(self.all.point, 0)
        there = gone & self.all.at_points & ~result.point_adjusted[point]
        return there & (np.bincount(point[there], minlength=len(result.point_adjusted))[point] > 1)

    def _from_robust(self, active: Bool, first: TestedBlock | None) -> Bool:
        """What is active after a robust adjustment; the block starts from there."""
        squares = None if first is None else first.result
        self.block = self.block if first is None else self._moved_by(first, active)
        result = robust(self.block, self.adjust, self.options, squares, coarse=True)
        for _ in range(MOST_SCALINGS if self.options.sigmas != "given" else 0):
            scaling, by = self.scaling.after(self.scaling.classes.scales(result, squares))
            self._rescale(scaling, by, from_result(self.block, result))
            if (by == 1.0).all():
                break
            again, _ = self._first(active)
            squares = None if again is None else again.result
            result = robust(self.block, self.adjust, self.options, squares, coarse=True)
        state = result.adjusted.state
        tests = [
            tests_of(replace(o, covariance=known_covariance(o, squares, i)), state)
            for i, o in enumerate(result.observations)
        ]
        tails = self._tails(result, squares)
        test = np.concatenate(tests) / tails
        above = active & (test > self.options.limit)
        self.block = from_result(self.block, result)
        alone = above & ~self.all.at_points
        points = np.unique(self.all.point[(above | (self.all.native & ~active)) & self.all.at_points])
        out = self.wrong_where_most_meet(result, points, active, test, tails)
        exchanged = exchanged_coordinates(self.all.observed, self.all.split(active & out), state, self.block.xyz_m)
        self.pool = replace(self.pool, counted=self.pool.counted & ~np.concatenate(exchanged))
        wrong = active & (out | alone)
        whole = self._whole_kind(wrong, active)
        if whole is not None:
            wrong[whole] = active[whole]
            self.whole[whole] = True
            self.pool = replace(self.pool, counted=self.pool.counted & ~self.whole)
        rejected = self.within_room(wrong, active, test)
        return (active | (self.all.native & self.of_points(points) & ~out)) & ~rejected

    def _whole_kind(self, wrong: Bool, active: Bool) -> slice | None:
        """A kind with more wrong than there is room for, where the rest agrees without it, and only without it."""
        left, counted = room_left(self.snooping, self.pool, active), self.pool.counted
        parts = [p for p, o in zip(self.all.parts, self.all.observed) if not is_ray(o) and active[p].any()]
        full = [p for k, p in enumerate(self.all.parts) if np.count_nonzero((wrong & counted)[p]) > max(left[k], 0)]
        if len(full) != 1 or full[0] not in parts:
            return None
        others = [p for p in parts if p != full[0]]
        return (
            full[0]
            if self._agrees(wrong, active, full[0], full[0])
            and not any(self._agrees(wrong, active, full[0], p) for p in others)
            else None
        )

    def _agrees(self, wrong: Bool, active: Bool, full: slice, without: slice) -> bool:
        """Whether the block agrees without one kind; `full` is that with too many wrong ones."""
        use = active & ~wrong
        use[full] = active[full]
        use[without] = False
        try:
            tried = self.solve(None, use)
        except (GeometryError, ConvergenceError):
            return False
        return not self._harmful(tried, use)

    def _moved_by(self, first: TestedBlock, active: Bool) -> BundleInput:
        """The block from where least squares has moved it; points with something above the limit may have run away."""
        above = active & self.all.at_points & ~(first.test <= self.options.limit)
        points = np.unique(self.all.point[above])
        moved = from_result(self.block, first.result)
        xyz = moved.xyz_m.copy()
        xyz[points] = self.block.xyz_m[points]
        return replace(moved, xyz_m=xyz)

    def solve(self, before: TestedBlock | None, use: Bool) -> TestedBlock:
        if before is not None and (use == before.active).all() and self._converged(before.result):
            return before
        block = self.block if before is None else from_result(self.block, before.result)
        block = replace(block, observed=self.all.without(block.observed, use))
        result = self.adjust(block, AdjustOptions())
        return TestedBlock(block, result, use, self.options, self._tails(result, anew=before is None))

    def _converged(self, result: BundleResult) -> bool:
        return result.adjusted.history[-1].decrement <= self.tolerance
