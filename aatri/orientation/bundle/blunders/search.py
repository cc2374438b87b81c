"""The search for gross errors in a bundle: robust start, data snooping, re-admission; every kind takes part.

1. Adjust by least squares, without exact coordinates that are far off (`exact_coordinates`), with standard deviations
   that fit the residuals (`scaling`). Where no |w| is above the limit, which counts the tests made, that is the
   result; but points that rejections of earlier stages contradict are asked again, all records of each.
2. Else adjust once more, robustly: gross errors smear in least squares, hardly in a robust adjustment. With its poses,
   held, each point with something above the limit, or rejected by an earlier stage, is looked at (`points`): the
   fewest records are left out without which the others agree. Of other kinds what is above the limit goes.
3. Adjust by least squares without it; of what is above the limit the clearest goes, at points by all that touch them;
   then what fits the block after all comes back (`adjustment.statistics.search`); until nothing changes.
4. Exact coordinates are tested (`exact_coordinates`); without the worst the search goes on.
5. What is out of other kinds than rays is tried against the others of its kind (`attribution_in_kind`).

The limit counts the tests, and knows the tails of the errors (`fitted_sigmas`).

Records that nothing tells apart are both left out, and nobody is blamed (`adjustment.statistics.attribution`). No more
of a kind is rejected than its redundancy answers for (`statistics.rejection`): where more disagrees single gross
errors explain nothing, and all of the kind stay. With a redundancy below `ESTIMABLE` large |w| may come of standard
deviations that are too small: only what stands out by the tau test too goes.

Source: Baarda 1968; Huber 1964; Foerstner 1983; docs/formulas.md 6.7, 7.3.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aatri.adjustment.openness.open_directions import OpenError
from aatri.adjustment.statistics import search as statistics
from aatri.adjustment.statistics.rejection import overfull, room_of
from aatri.arrays import Bool
from aatri.notes import Note
from aatri.observations.poses import POSE
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.blunders.attribution_in_kind import attributed_in_kind
from aatri.orientation.bundle.blunders.exact_coordinates import ExactCoordinates, SearchEnd, exact_notes
from aatri.orientation.bundle.blunders.limits import HARMLESS
from aatri.orientation.bundle.blunders.points import well_intersected
from aatri.orientation.bundle.blunders.renumbered_rays import renumbered_rays
from aatri.orientation.bundle.blunders.robust import Adjust, AdjustOptions
from aatri.orientation.bundle.blunders.search_notes import SearchOutcome, findings
from aatri.orientation.bundle.blunders.search_options import SearchOptions
from aatri.orientation.bundle.blunders.swaps import Swap, swaps
from aatri.orientation.bundle.blunders.tested_block import TestedBlock
from aatri.orientation.bundle.result import BundleResult
from aatri.orientation.bundle.rounds import AdjustedBlock, keys_of, with_readmission

ROBUST_START = "least squares of all observations do not converge: the search began with a robust adjustment"

UNTESTED = (
    "gross errors were not searched for: no observation has a test, for nothing controls it, or the block was solved "
    "without standard deviations"
)


def search(
    block: BundleInput,
    adjust: Adjust,
    options: SearchOptions,
    tolerance: float = 1e-3,
    least_squares: list[BundleResult] | None = None,
) -> AdjustedBlock:
    """Adjust a block and leave out its gross errors.

    Parameters
    ----------
    block : BundleInput
        What earlier stages have rejected is not active, and may come back.
    tolerance : float
        Bound of the Newton decrement of the result.
    least_squares : list of BundleResult, optional
        Least squares with everything, where that is known; it is taken out, as it is as large as what follows.

    Raises
    ------
    GeometryError, ConvergenceError
        If the block cannot be adjusted, robustly neither.
    """
    return _Search(block, adjust, options, tolerance).run(least_squares)


class _Search(ExactCoordinates):
    """The steps of a search."""

    def run(self, least_squares: list[BundleResult] | None) -> AdjustedBlock:
        """Search."""
        active = self.initially_active = self.all.native & ~self.all.rejected_in(self.block)
        self.of_datum = np.zeros_like(active)
        initial = self._tested(least_squares.pop(), active) if least_squares else self._initial_least_squares(active)
        if initial is not None and not np.isfinite(initial.test).any():
            untested = with_readmission(self.block, lambda block: self.adjust(block, AdjustOptions()))
            return replace(untested, notes=(*untested.notes, Note("warning", UNTESTED)))
        redundancy, count = self.all.redundancy(None if initial is None else initial.result)
        self.pool = replace(self.pool, room=room_of(redundancy, count, self.options.max_share))
        began = active
        if initial is not None:
            initial, active = self.without_far_exact(initial, active)
        far_exact = np.flatnonzero(began & ~active)
        start = None if initial is None else self._with_fitting_sigmas(initial)
        if (readmitted := self._readmitted_by_larger_sigmas(active, start)).any():
            active = self.initially_active = active | readmitted
            self.block = replace(self.block, observed=self.all.without(self.block.observed, active))
            start = self._initial_least_squares(active)
            start = None if start is None else self._with_fitting_sigmas(start)
        harmful = start is None or ((self.smeared or self._is_harmful(start, active)) and not start.low_redundancy)
        self.robust_instead = start is None and self.options.method == "data_snooping"
        if harmful and (self.options.method == "robust_snooping" or start is None):
            start, active = self._solved_after_robust(active, start)
            start = self._with_fitting_sigmas(start)
        else:
            assert start is not None
            start, active = self._without_errors_of_lost_points(start, active)
        assert start is not None
        del initial  # its tests are as long as the block, and are made again with the tails
        taken_out = [replace(start, tails=self._tails(start.result))]
        del start
        searched = self.data_snooping(taken_out, active)
        return self._concluded(*self.without_wrong_exact(searched, self.data_snooping, far_exact))

    def _concluded(self, searched: SearchEnd, wrong: Bool) -> AdjustedBlock:
        """The adjusted block, and what was found; `wrong` are exact coordinates that contradict it."""
        tested, use, swapped = searched
        exchanged = self._rows_of(swapped)
        above_limit = use & ((tested.largest_w if tested.low_redundancy else tested.test) > self.options.w_limit)
        attribution = attributed_in_kind(tested, self.undecided & ~use, exchanged, self.all, self.adjust, above_limit)
        tested, use = attribution.tested, attribution.tested.active
        rejected = self.all.native & ~use
        undecided = rejected & (self.undecided | attribution.undecided | self._undecidable(tested.result, rejected))
        rejected_by_kind = self.all.split(rejected)
        limit = self.options.w_limit
        renumbered = tuple(renumbered_rays(tested.result, self.block.rays, rejected_by_kind, limit, swapped))
        above_limit = use & ((tested.largest_w if tested.low_redundancy else tested.test) > limit)
        doubtful = above_limit & self.at_doubtful_points
        kept_ambiguous = use & self.kept & self.at_points_of(np.unique(self.all.point[doubtful]))
        above_limit &= ~attribution.kept & ~doubtful
        outcome = SearchOutcome(
            use,
            undecided,
            above_limit,
            kept_ambiguous,
            renumbered,
            tested.low_redundancy,
            tested.largest_w,
            self.rejected_kinds,
            self.of_datum & use & ~attribution.kept,
        )
        search_notes = (
            *self._tail_notes(use, tested.largest_w),
            *findings(tested.block, self.all, outcome, self.options),
        )
        final = self._final_adjustment(tested)
        notes = (
            *self.scaling.notes(of_result=self.options.sigmas == "estimated"),
            *search_notes,
            *exact_notes(self.all, wrong & use),
            *attribution.notes,
            *([Note("note", ROBUST_START)] if self.robust_instead else []),
        )
        exchanged_keys = tuple(keys_of(self.all.observed[s.place], np.array([s.first, s.second])) for s in swapped)
        return AdjustedBlock(
            *final,
            notes,
            self.all.keys(undecided),
            self.all.keys(above_limit | doubtful | kept_ambiguous | attribution.kept | (wrong & use)),
            tuple((a, b) for a, b in exchanged_keys),
            renumbered,
            self.scaling.main_factor if self.options.sigmas == "estimated" else 1.0,
        )

    def _solved_after_robust(self, active: Bool, start: TestedBlock | None) -> tuple[TestedBlock, Bool]:
        """Adjusted without what a robust adjustment rejects.

        Where the datum would be open, the kind with the fewest rejections that closes it comes back, or all but rays.
        """
        less = self._active_after_robust(active, start)
        out = active & ~less & ~(self.all.at_points & ~self.all.coordinates)
        kind = np.repeat(np.arange(len(self.all.parts)), np.diff(self.all.first))
        of_kinds = sorted((out & (kind == k) for k in np.unique(kind[out])), key=np.count_nonzero)
        failures: list[OpenError] = []
        for back in (np.zeros_like(out), *of_kinds, *([out] if len(of_kinds) > 1 else [])):
            try:
                tested = self.solve(None, less | back)
            except OpenError as error:
                failures.append(error)
                continue
            self.of_datum = back
            return tested, less | back
        raise failures[0]

    def _without_errors_of_lost_points(self, start: TestedBlock, active: Bool) -> tuple[TestedBlock, Bool]:
        """Adjusted without what is wrong at the points that rays contradict which an earlier stage has rejected.

        What an earlier stage has left there may agree by itself and be wrong: two rays whose error lies along their
        base. All records of the point are held against each other, also those that are out.
        """
        rays = self.all.at_points & ~self.all.coordinates
        contradicted = self.all.native & rays & ~active & (start.test > self.options.w_limit)
        points = np.unique(self.all.point[contradicted])
        if not len(points):
            return start, active
        wrong = self.gross_errors_at_intersections(start.result, points, active, start.test, start.tails)
        use = np.where(self.at_points_of(points), self.all.native & ~wrong, active)
        return (start, active) if (use == active).all() else (self.solve(None, use), use)

    def _readmitted_by_larger_sigmas(self, active: Bool, start: TestedBlock | None) -> Bool:
        """What an earlier stage has rejected of classes whose standard deviations turned out too small, (n,).

        It had rejected the larger errors, so that the new standard deviations are still too small, by less than what
        they grew by. What is farther off is wrong by any of them, and would bend the block.
        """
        factor = self._smallest_factors(self.scaling.factor)
        readmitted = self.all.native & ~active & (factor > 1.0)
        return readmitted if start is None else readmitted & ~(start.test > self.options.w_limit * factor)

    def data_snooping(self, start: list[TestedBlock], active: Bool) -> SearchEnd:
        """Search; exchanged numbers are explained: where they took up the room of a kind, search on without them.

        Parameters
        ----------
        start : list of TestedBlock
            Where it begins; taken out, as it is as large as what follows.
        """

        def solve(previous: TestedBlock | None, use: Bool, _: float) -> TestedBlock:
            return self.solve(previous, use)

        while True:
            searched = statistics.search(
                solve,
                active,
                self.snooping,
                self.pool,
                self.next_rejections,
                first=statistics.SearchState(self._with_all_accuracy(start, active)),  # a name would keep it
            )
            tested, use = searched.solved, searched.active
            del searched
            rejected = self.all.split(self.all.native & ~use)
            swapped = tuple(swaps(tested.result, self.block.rays, rejected, self.options.w_limit))
            explained = self._rows_of(swapped) & self.pool.counted
            above_limit = use & (tested.test > self.options.w_limit)
            if explained.any() and above_limit.any():
                self.pool = replace(self.pool, counted=self.pool.counted & ~explained)
                start, active = [tested], use
                del tested
                continue
            initially_active = self.initially_active & self.pool.counted
            overfull_kinds, readmitted = overfull(
                self.snooping, self.pool, above_limit & ~self.at_doubtful_points, use, initially_active
            )
            assert self.pool.room is not None
            self.pool.room[overfull_kinds] = 0  # all of the kind come back, and nothing goes again
            readmitted = readmitted if readmitted.any() else self._agreeing_at_lost_points(tested, use)
            if not readmitted.any():
                return tested, use, swapped
            start, active = [tested], use | readmitted
            del tested

    def _rows_of(self, swapped: Sequence[Swap]) -> Bool:
        """What fits with each other's numbers, (n,)."""
        rows = [self.all.first[s.place] + row for s in swapped for row in (s.first, s.second)]
        return np.isin(np.arange(len(self.all.native)), rows)

    def _agreeing_at_lost_points(self, tested: TestedBlock, use: Bool) -> Bool:
        """What nearly agrees at points that were lost, to earlier stages or before something else went, (n,).

        The block tests it.
        """
        rejected, rays, result = self.all.native & self.all.at_points & ~use, self.block.rays, tested.result
        points = np.unique(self.all.point[rejected])
        points = points[~result.point_adjusted[points] & (self.attributions[points] < 2)]  # asked once, or never
        if rays is None or not len(points):
            return np.zeros_like(use)
        self.attributions[points] += 1
        xyz, poses = self.robust_intersections(result, points), result.adjusted.state[POSE]
        rays = replace(rays, active=rays.active & result.image_adjusted[rays.image])
        no_suspects, tails = np.zeros(len(points), dtype=bool), HARMLESS * tested.tails
        wrong = self.gross_errors_at(result, points, no_suspects, use, tested.test, tails, move=True, xyz_m=xyz)
        return rejected & self.at_points_of(well_intersected(rays, poses, xyz, points)) & ~wrong

    def _undecidable(self, result: BundleResult, rejected: Bool) -> Bool:
        """Records of points that were lost with two of them and more: what is wrong there nobody can tell."""
        point = np.maximum(self.all.point, 0)
        lost_records = rejected & self.all.at_points & ~result.point_adjusted[point]
        return lost_records & (np.bincount(point[lost_records], minlength=len(result.point_adjusted))[point] > 1)
