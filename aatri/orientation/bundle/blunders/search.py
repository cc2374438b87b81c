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

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from aatri.adjustment.records import whitened_residuals
from aatri.adjustment.statistics import search as statistics
from aatri.adjustment.statistics.rejection import Pool, Snooping, clearest, pool_of
from aatri.adjustment.statistics.tau import tau_limit
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
from aatri.orientation.bundle.blunders.swaps import swaps
from aatri.orientation.bundle.blunders.told import Found, findings
from aatri.orientation.bundle.result import AdjustedObservations, BundleResult, from_result
from aatri.orientation.bundle.rounds import Round, with_readmission

WELL_CONTROLLED = 1e-3
"""Components with a smaller redundancy number are not tested: what controls them could not be told apart."""

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

FEW = 10
"""Redundancy below which sigma0 a priori cannot be taken for granted: that from which variances are estimable."""

STANDS_OUT = 3.29
"""Limit, as that of |w|, of the tau test of small networks."""

CLEAR = {"robust_snooping": 0.0, "data_snooping": 0.5}
"""Least test of a rejection, as a share of the largest of the round: after a robust start what is left is small."""


@dataclass(frozen=True)
class Tried:
    """A block adjusted without some of its records, and the tests of all of them."""

    given: BundleInput
    result: BundleResult
    active: Bool
    rule: Rule

    @cached_property
    def plain(self) -> Float:
        """Largest |w| of each record, kind after kind; predicted where not active."""
        return np.concatenate([tests_of(o, self.result.adjusted.state) for o in self.result.observations])

    @property
    def small(self) -> bool:
        """Whether there is too little redundancy to tell a gross error from wrong standard deviations by |w| alone."""
        return self.result.adjusted.redundancy < FEW

    @cached_property
    def test(self) -> Float:
        """|w| over the limit's unit: with little redundancy a gross error is one that also stands out of the others."""
        adjusted, limit, unit = self.result.adjusted, self.rule.limit, 1.0
        if self.rule.tau:
            unit = adjusted.sigma0 * tau_limit(limit, adjusted.redundancy) / limit
        elif self.small and adjusted.redundancy > 0:
            unit = max(1.0, adjusted.sigma0 * tau_limit(min(limit, STANDS_OUT), adjusted.redundancy) / limit)
        return self.plain / unit

    def controlled(self, rows: Int) -> Bool:
        """All that has a test is controlled well enough."""
        return np.ones(len(rows), dtype=bool)

    def added_sigma(self, *, robust: bool) -> float:  # noqa: ARG002
        """A bundle adds nothing to its standard deviations."""
        return 0.0


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
        found = statistics.search(
            lambda before, use, _: self._solve(before or start, use), active, self.snooping, self.pool, self._found
        )
        tried, use = found.solved, found.active
        gone = self.all.native & ~use
        undecided = gone & (self.undecided | self._lost(tried.result, gone))
        asked = (tried.result, self.given.rays, self.all.split(gone), self.rule.limit)
        swapped = tuple(swaps(*asked))
        renumbered = tuple(other_numbers(*asked, swapped))
        doubtful = self.all.at_points & self.doubtful[np.maximum(self.all.point, 0)]
        above = use & ((tried.plain if tried.small else tried.test) > self.rule.limit)
        told = Found(use, undecided, above, doubtful, swapped, renumbered, tried.small)
        notes = findings(tried.given, self.all, told, self.rule)
        split = self.all.split
        return Round(tried.given, tried.result, tuple(notes), split(undecided), split(above), swapped, renumbered)

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
            tests_of(replace(o, covariance=_known(o, squares, i)), state) for i, o in enumerate(result.observations)
        ]
        above = active & (np.concatenate(tests) > self.rule.limit)
        self.given = from_result(given, result)
        alone = above & ~self.all.at_points
        points = np.unique(self.all.point[(above | (self.all.native & ~active)) & self.all.at_points])
        out = self._heard(state, points, np.zeros(len(points), dtype=bool), active, np.concatenate(tests), move=True)
        rejected = self._within_share(active & (out | alone), active, np.concatenate(tests))
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
        picked = clearest(self.snooping, self.pool, tried.test, use)
        at = picked & self.all.at_points
        points = np.unique(self.all.point[at])
        points = points[(self.hearings[points] < MOST_HEARINGS) & ~self.doubtful[points]]
        state, suspected = tried.result.adjusted.state, np.ones(len(points), dtype=bool)
        out = self._heard(state, points, suspected, use, tried.test, move=False) & use
        heard = np.isin(self.all.point, np.unique(self.all.point[out])) | self.doubtful[np.maximum(self.all.point, 0)]
        blamed = picked & ~(heard & self.all.at_points)
        return self._within_share(out | blamed, use, tried.test)

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
            native = self.all.native[part]
            room = int(np.ceil(self.rule.max_share * native.sum())) - int((native & ~active[part]).sum())
            if len(some) > max(room, 0):
                order = np.argsort(-np.nan_to_num(test[some]), kind="stable")
                kept[some[order[max(room, 0) :]]] = False
        return kept


def tests_of(found: AdjustedObservations, state: State) -> Float:
    """Largest |w| of the components of each record of one kind, (n,); NaN without test, see `record_tests`."""
    records, rows = found.observed.records, found.rows
    test = np.full(len(found.observed), np.nan)
    if len(rows) and not (found.observed.exact or found.observed.components):
        v = whitened_residuals(records, state, rows)
        sign = np.where(records.active[rows], -1.0, 1.0)[:, None]
        r = 1.0 + sign * np.einsum("nii->ni", found.covariance[rows])
        tested = records.observed_components()[rows] & (r > WELL_CONTROLLED)
        w = np.where(tested, np.abs(v) / np.sqrt(np.where(tested, r, 1.0)), -1.0).max(axis=1)
        test[rows] = np.where(w >= 0, w, np.nan)
    return test


def _known(found: AdjustedObservations, squares: BundleResult | None, i: int) -> Float:
    """Covariances of the adjusted values as least squares has them; zero where it failed."""
    return np.zeros_like(found.covariance) if squares is None else squares.observations[i].covariance
