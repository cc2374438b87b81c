"""The search for gross errors in a bundle: robust start, data snooping, re-admission; every kind takes part.

1. Adjust by least squares. Where no |w| is above the limit, that is the result.
2. Else adjust once more, robustly: gross errors smear in least squares, hardly in a robust adjustment. With its poses,
   held, each point with something above the limit, or rejected by an earlier stage, gets a hearing (`points`): the
   fewest records are left out without which the others agree. Of other kinds what is above the limit goes.
3. Adjust by least squares without it; of what is above the limit the clearest goes, by the same hearing at points; then
   what fits the block after all comes back (`adjustment.statistics.search`); until nothing changes.

Records that nothing tells apart are both left out, and nobody is blamed (`adjustment.statistics.attribution`). No more
than `max_share` of a kind is rejected: where more disagrees the model is wrong, not the data. With a redundancy below
`FEW` large |w| may come of standard deviations that are too small: only what stands out by the tau test too goes.

Source: Baarda 1968; Huber 1964; Foerstner 1983; docs/formulas.md 6.7, 7.3.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aatri.adjustment.statistics import search as statistics
from aatri.adjustment.statistics.rejection import Pool, Snooping, clearest, pool_of
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int
from aatri.errors import ConvergenceError, GeometryError
from aatri.notes import Note
from aatri.observations.poses import POINT
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.blunders.kinds import AllRecords
from aatri.orientation.bundle.blunders.other_numbers import other_numbers
from aatri.orientation.bundle.blunders.points import AtPoints, explained, with_start
from aatri.orientation.bundle.blunders.robust import Adjust, How, robust
from aatri.orientation.bundle.blunders.rule import Rule
from aatri.orientation.bundle.blunders.swaps import Swap, exchanged_coordinates, swaps
from aatri.orientation.bundle.blunders.tested import Tried, known_covariance, tests_of
from aatri.orientation.bundle.blunders.told import Found, findings, more_than_share
from aatri.orientation.bundle.result import BundleResult, from_result
from aatri.orientation.bundle.rounds import Round, with_readmission

UNTESTED = (
    "gross errors were not searched for: no observation has a test, for nothing controls it, or the block was solved "
    "without standard deviations"
)

BACK = 3.29
"""|w| below which what was rejected comes back: below the limit, or what lies there would go to and fro."""

DOUBT = 1.5
"""Records that nothing tells apart are left out where a test is beyond so many limits; else they stay, and are named:
the harm is small, and one of them, of a control point perhaps, is as good as the others."""

HARMLESS = 2.0
"""Tests up to this many limits smear so little that no robust adjustment is needed."""

MOST_HEARINGS = 3

CLEAR = {"robust_snooping": 0.0, "data_snooping": 0.5}
"""Least test of a rejection, as a share of the largest of the round: after a robust start what is left is small."""


def search(given: BundleInput, adjust: Adjust, rule: Rule, tolerance: float = 1e-3) -> Round:
    """Adjust a block and leave out its gross errors.

    Parameters
    ----------
    given : BundleInput
        What earlier stages have rejected is not active, and may come back.
    adjust : callable
    rule : Rule
    tolerance : float
        Bound of the Newton decrement of the result.

    Raises
    ------
    GeometryError, ConvergenceError
        If the block cannot be adjusted, robustly neither.
    """
    return _Search(given, adjust, rule, tolerance).run()


class _Search:
    """What the steps of a search share."""

    def __init__(self, given: BundleInput, adjust: Adjust, rule: Rule, tolerance: float) -> None:
        self.given, self.adjust, self.rule, self.tolerance = given, adjust, rule, tolerance
        self.all = AllRecords.of(given)
        observed = [o.records for o in self.all.observed]
        self.snooping = Snooping(
            rule.limit, (POINT,), ("", rule.max_share), CLEAR[rule.method], 1.0, min(BACK, rule.limit)
        )
        pool = pool_of(self.snooping, observed, [np.zeros(len(r.active)) for r in observed])
        self.pool: Pool = replace(pool, counted=self.all.native)
        self.undecided = np.zeros(len(self.all.native), dtype=bool)
        self.hearings = np.zeros(len(given.point_ids), dtype=np.int64)
        self.doubtful = np.zeros(len(given.point_ids), dtype=bool)
        self.more: list[Note] = []

    def run(self) -> Round:
        """Search."""
        active = self.all.native & ~self.all.rejected_in(self.given)
        first, failure = self._first(active)
        if first is not None and not np.isfinite(first.test).any():
            plain = with_readmission(self.given, lambda block: self.adjust(block, How()))
            return replace(plain, notes=(*plain.notes, Note("warning", UNTESTED)))
        start: Tried | None = first
        harmful = first is None or (self._harmful(first, active) and not first.small)
        if self.rule.method == "robust_snooping" and harmful:
            active, start = self._from_robust(active, first), None
        elif first is None and failure is not None:
            raise failure
        tried, use, swapped = self._searched(start, active)
        gone = self.all.native & ~use
        undecided = gone & (self.undecided | self._lost(tried.result, gone))
        asked = (tried.result, self.given.rays, self.all.split(gone), self.rule.limit)
        renumbered = tuple(other_numbers(*asked, swapped))
        doubtful = self.all.at_points & self.doubtful[np.maximum(self.all.point, 0)]
        above = use & ((tried.plain if tried.small else tried.test) > self.rule.limit)
        told = Found(use, undecided, above, doubtful, swapped, renumbered, tried.small)
        notes = findings(tried.given, self.all, told, self.rule) + (self.more if above.any() else [])
        split = self.all.split
        return Round(tried.given, tried.result, tuple(notes), split(undecided), split(above), swapped, renumbered)

    def _searched(self, start: Tried | None, active: Bool) -> tuple[Tried, Bool, tuple[Swap, ...]]:
        """Search; exchanged numbers are explained: where they took up the share of a kind, search on without them."""
        first = start

        def solve(before: Tried | None, use: Bool, _: float) -> Tried:
            return self._solve(before or first, use)

        while True:
            found = statistics.search(solve, active, self.snooping, self.pool, self._found)
            tried, use = found.solved, found.active
            gone = self.all.split(self.all.native & ~use)
            swapped = tuple(swaps(tried.result, self.given.rays, gone, self.rule.limit))
            rows = [self.all.first[s.place] + row for s in swapped for row in (s.first, s.second)]
            explained = np.isin(np.arange(len(use)), rows) & self.pool.counted
            if not explained.any() or not (use & (tried.test > self.rule.limit)).any():
                return tried, use, swapped
            self.pool = replace(self.pool, counted=self.pool.counted & ~explained)
            first, active = tried, use

    def _lost(self, result: BundleResult, gone: Bool) -> Bool:
        """Records of points that were lost with two of them and more: what is wrong there nobody can tell."""
        point = np.maximum(self.all.point, 0)
        there = gone & self.all.at_points & ~result.point_adjusted[point]
        return there & (np.bincount(point[there], minlength=len(result.point_adjusted))[point] > 1)

    def _first(self, active: Bool) -> tuple[Tried | None, Exception | None]:
        """Least squares with everything; None where that fails."""
        try:
            return Tried(self.given, self.adjust(self.given, How(coarse=True)), active, self.rule), None
        except (ConvergenceError, GeometryError) as error:
            return None, error

    def _harmful(self, tried: Tried, active: Bool) -> bool:
        return bool((active & (tried.test > HARMLESS * self.rule.limit)).any())

    def _from_robust(self, active: Bool, first: Tried | None) -> Bool:
        """What is active after a robust adjustment; the block starts from there."""
        squares = None if first is None else first.result
        given = self.given if first is None else self._moved_by(first, active)
        result = robust(given, self.adjust, self.rule, squares, coarse=True)
        state = result.adjusted.state
        tests = [
            tests_of(replace(o, covariance=known_covariance(o, squares, i)), state)
            for i, o in enumerate(result.observations)
        ]
        above = active & (np.concatenate(tests) > self.rule.limit)
        self.given = from_result(given, result)
        alone = above & ~self.all.at_points
        points = np.unique(self.all.point[(above | (self.all.native & ~active)) & self.all.at_points])
        out = self._heard(state, points, np.zeros(len(points), dtype=bool), active, np.concatenate(tests), move=True)
        exchanged = exchanged_coordinates(self.all.observed, self.all.split(active & out), state, self.given.xyz_m)
        self.pool = replace(self.pool, counted=self.pool.counted & ~np.concatenate(exchanged))
        wrong = active & (out | alone)
        self.more = more_than_share(self.all, wrong, self.rule)
        rejected = self._within_share(wrong, active, np.concatenate(tests))
        return (active | (self.all.native & self._of(points) & ~out)) & ~rejected

    def _moved_by(self, first: Tried, active: Bool) -> BundleInput:
        """The block from where least squares has moved it; points with something above the limit may have run away."""
        above = active & self.all.at_points & ~(first.test <= self.rule.limit)
        points = np.unique(self.all.point[above])
        moved = from_result(self.given, first.result)
        xyz = moved.xyz_m.copy()
        xyz[points] = self.given.xyz_m[points]
        return replace(moved, xyz_m=xyz)

    def _of(self, points: Int) -> Bool:
        return self.all.at_points & np.isin(self.all.point, points)

    def _solve(self, before: Tried | None, use: Bool) -> Tried:
        if before is not None and (use == before.active).all() and self._converged(before.result):
            return before
        given = self.given if before is None else from_result(self.given, before.result)
        given = replace(given, observed=self.all.without(given.observed, use))
        return Tried(given, self.adjust(given, How()), use, self.rule)

    def _converged(self, result: BundleResult) -> bool:
        return result.adjusted.history[-1].decrement <= self.tolerance

    def _found(self, tried: Tried, use: Bool) -> Bool:
        """The clearest gross errors, at points by a hearing of all records of the point."""
        picked = clearest(self.snooping, self.pool, tried.test, use, ~self._in_stead(tried.test, use))
        at = picked & self.all.at_points
        points = np.unique(self.all.point[at])
        points = points[(self.hearings[points] < MOST_HEARINGS) & ~self.doubtful[points]]
        state, suspected = tried.result.adjusted.state, np.ones(len(points), dtype=bool)
        out = self._heard(state, points, suspected, use, tried.test, move=False) & use
        heard = np.isin(self.all.point, np.unique(self.all.point[out])) | self.doubtful[np.maximum(self.all.point, 0)]
        blamed = picked & ~(heard & self.all.at_points)
        kept = self._within_share(out | blamed, use, tried.test)
        # Where the coordinates of a point may not go, its rays do not go in their stead.
        other = self.all.coordinates & (out | blamed) & ~kept
        return kept & ~self._of(np.unique(self.all.point[other]))

    def _in_stead(self, test: Float, use: Bool) -> Bool:
        """Records at points whose coordinates are the clearest there, and may not go: they do not go in their stead."""
        above = use & self.all.coordinates & (test > self.rule.limit)
        held = np.flatnonzero(above & ~self._within_share(above, use, test))
        largest = np.zeros(len(self.hearings))
        np.maximum.at(largest, self.all.point[held], test[held])
        return self.all.at_points & (test <= largest[np.maximum(self.all.point, 0)] + 1e-6)

    def _heard(self, state: State, points: Int, suspected: Bool, active: Bool, test: Float, *, move: bool) -> Bool:
        """What is wrong at some points, (n,); with `move` the block starts with them where the others see them."""
        known = np.isin(points, with_start(state[POINT], points))
        points, suspected = points[known], suspected[known]
        wrong = np.zeros(len(active), dtype=bool)
        if not len(points):
            return wrong
        self.hearings[points] += 1
        native = self.all.split(self.all.native if move else active)
        found: AtPoints = explained(self.all.observed, native, state, points, suspected, self.rule.limit)
        rows = self.all.first[found.members.place] + found.members.row
        largest = np.zeros(len(points))
        np.maximum.at(largest, found.members.block, np.where(active, np.nan_to_num(test), np.inf)[rows])
        unclear = np.zeros(len(points), dtype=bool)
        unclear[found.members.block[found.undecided]] = True
        doubt = unclear & (largest <= DOUBT * self.rule.limit)
        self.doubtful[points] = doubt
        surely = ~doubt[found.members.block]
        wrong[rows[found.out & surely]] = True
        self.undecided[rows] = found.undecided & surely
        if move:
            xyz = self.given.xyz_m.copy()
            xyz[points] = found.xyz_m
            self.given = replace(self.given, xyz_m=xyz)
        return wrong

    def _within_share(self, wrong: Bool, active: Bool, test: Float) -> Bool:
        """Of what is wrong as much as may be rejected of each kind, the clearest first."""
        kept = wrong.copy()
        for part in self.all.parts:
            some = np.flatnonzero(wrong[part]) + part.start
            native = self.pool.counted[part]
            some = some[native[some - part.start]]
            room = int(np.ceil(self.rule.max_share * native.sum())) - int((native & ~active[part]).sum())
            if len(some) > max(room, 0):
                order = np.argsort(-np.nan_to_num(test[some]), kind="stable")
                kept[some[order[max(room, 0) :]]] = False
        return kept
