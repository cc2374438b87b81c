"""What a search decides at each step: which records go, of a point by all that touch it, within the room."""

from dataclasses import replace

import numpy as np

from aatri.adjustment.statistics.rejection import Pool, Snooping, clearest, pool_of, room_left
from aatri.arrays import Bool, Float, Int
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.blunders.all_records import AllRecords
from aatri.orientation.bundle.blunders.points import AtPoints, explained, with_start
from aatri.orientation.bundle.blunders.search_options import SearchOptions
from aatri.orientation.bundle.blunders.tested_block import TestedBlock, gains_of
from aatri.orientation.bundle.complete_start import where_most_meet
from aatri.orientation.bundle.result import BundleResult

DOUBT = 6.0
"""|w| up to which records that nothing tells apart stay, and are named: the harm is small, and one of them, of a
control point perhaps, is as good as the others."""

MOST_ATTRIBUTIONS = 3

CLEAR = {"robust_snooping": 0.0, "data_snooping": 0.5}
"""Least test of a rejection, as a share of the largest of the round: after a robust start what is left is small."""


class Rejections:
    """The records of a block, the rules for them, and what attributions at points have come to.

    Attributes
    ----------
    block : BundleInput
        Where the next adjustment starts.
    all : AllRecords
    options : SearchOptions
        With the limit of all tests.
    snooping, pool
        The same for `adjustment.statistics.rejection`.
    undecided : (n,) bool
        Left out though only some of them are wrong.
    attributions : (n_points,) int64
    doubtful : (n_points,) bool
        Points where nothing tells what is wrong, and it is small.
    kept : (n,) bool
        Records of which one is wrong there.
    """

    def __init__(self, block: BundleInput, options: SearchOptions) -> None:
        self.block, self.all = block, AllRecords.of(block)
        self.options = options = options.for_tests(self.all.tests)
        observed = [o.records for o in self.all.observed]
        self.snooping = Snooping(options.limit, (POINT,), ("", 1.0), CLEAR[options.method], 1.0)
        pool = pool_of(self.snooping, observed, [np.zeros(len(r.active)) for r in observed])
        self.pool: Pool = replace(pool, counted=self.all.native)
        self.undecided = np.zeros(len(self.all.native), dtype=bool)
        self.attributions = np.zeros(len(block.point_ids), dtype=np.int64)
        self.doubtful = np.zeros(len(block.point_ids), dtype=bool)
        self.kept = np.zeros(len(self.all.native), dtype=bool)

    def next_rejections(self, tried: TestedBlock, use: Bool) -> Bool:
        """The clearest gross errors, at points by all records of the point."""
        picked = clearest(self.snooping, self.pool, tried.test, use, ~self._in_stead(tried.test, use))
        at = picked & self.all.at_points
        points = np.unique(self.all.point[at])
        points = points[(self.attributions[points] < MOST_ATTRIBUTIONS) & ~self.doubtful[points]]
        suspected = np.ones(len(points), dtype=bool)
        out = self.wrong_at_points(tried.result, points, suspected, use, tried.test, tried.tails, move=False) & use
        attributed = np.isin(self.all.point, np.unique(self.all.point[out]))
        attributed |= self.at_doubtful
        blamed = picked & ~(attributed & self.all.at_points)
        kept = self.within_room(out | blamed, use, tried.test)
        # Where the coordinates of a point may not go, its rays do not go in their stead.
        other = self.all.coordinates & (out | blamed) & ~kept
        return kept & ~self.of_points(np.unique(self.all.point[other]))

    def _in_stead(self, test: Float, use: Bool) -> Bool:
        """Records at points whose coordinates are the clearest there, and may not go: they do not go in their stead."""
        above = use & self.all.coordinates & (test > self.options.limit)
        held = np.flatnonzero(above & ~self.within_room(above, use, test))
        largest = np.zeros(len(self.attributions))
        np.maximum.at(largest, self.all.point[held], test[held])
        return self.all.at_points & (test <= largest[np.maximum(self.all.point, 0)] + 1e-6)

    def wrong_at_points(
        self,
        result: BundleResult,
        points: Int,
        suspected: Bool,
        active: Bool,
        test: Float,
        tails: Float,
        *,
        move: bool,
        xyz_m: Float | None = None,
    ) -> Bool:
        """What is wrong at some points, (n,); with `move` the block starts with them where the others see them."""
        state = result.adjusted.state if xyz_m is None else {**result.adjusted.state, POINT: xyz_m}
        known = np.isin(points, with_start(state[POINT], points))
        points, suspected = points[known], suspected[known]
        wrong = np.zeros(len(active), dtype=bool)
        if not len(points):
            return wrong
        self.attributions[points] += 1
        seen = (self.all.image < 0) | result.image_adjusted[self.all.image]  # what the other images see is no witness
        native = self.all.split((self.all.native if move else active) & seen)
        limits = tuple(self.options.limit * of_kind for of_kind in self.all.split(tails))
        found: AtPoints = explained(self.all.observed, native, state, points, suspected, limits)
        if not move:
            found = found.told_apart(_gains(found, result))
        rows = self.all.first[found.members.place] + found.members.row
        largest = np.zeros(len(points))
        np.maximum.at(largest, found.members.block, np.where(active, np.nan_to_num(test), np.inf)[rows])
        unclear = np.zeros(len(points), dtype=bool)
        unclear[found.members.block[found.undecided]] = True
        doubt = unclear & (largest <= max(DOUBT, self.options.limit))
        self.doubtful[points] = doubt
        surely = ~doubt[found.members.block]
        wrong[rows[found.out & surely]] = True
        self.undecided[rows], self.kept[rows] = found.undecided & surely, found.undecided & ~surely
        if move:
            xyz = self.block.xyz_m.copy()
            xyz[points] = found.xyz_m
            self.block = replace(self.block, xyz_m=xyz)
        return wrong

    def wrong_where_most_meet(self, result: BundleResult, points: Int, active: Bool, test: Float, tails: Float) -> Bool:
        """What is wrong at some points, (n,), of all records there, from where most of their rays meet."""
        xyz, nothing = self.where_most_meet(result, points), np.zeros(len(points), dtype=bool)
        return self.wrong_at_points(result, points, nothing, active, test, tails, move=True, xyz_m=xyz)

    def where_most_meet(self, result: BundleResult, points: Int) -> Float:
        """The points of a result, some of them where most of their rays meet: a wrong ray may have drawn them away."""
        xyz, rays = result.adjusted.state[POINT].copy(), self.block.rays
        if rays is not None:
            rays = replace(rays, active=rays.active & result.image_adjusted[rays.image])
            met = where_most_meet(rays, result.adjusted.state[POSE], points, len(xyz))
            xyz = np.where(np.isfinite(met), met, xyz)
        return np.asarray(xyz)

    def within_room(self, wrong: Bool, active: Bool, test: Float) -> Bool:
        """Of what is wrong as much as there is room for in each kind, the clearest first."""
        kept, left = wrong.copy(), np.maximum(room_left(self.snooping, self.pool, active), 0)
        for room, part in zip(left, self.all.parts):
            some = np.flatnonzero(wrong[part] & self.pool.counted[part]) + part.start
            if len(some) > room:
                order = np.argsort(-np.nan_to_num(test[some]), kind="stable")
                kept[some[order[room:]]] = False
        return kept

    @property
    def at_doubtful(self) -> Bool:
        """Records at points where nothing tells what is wrong, (n,)."""
        return self.all.at_points & self.doubtful[np.maximum(self.all.point, 0)]

    def of_points(self, points: Int) -> Bool:
        return self.all.at_points & np.isin(self.all.point, points)


def _gains(found: AtPoints, result: BundleResult) -> Float:
    """What leaving out each undecided member gains in the whole block, (r,); NaN for others."""
    gain = np.full(len(found.out), np.nan)
    for place in np.unique(found.members.place[found.undecided]).tolist():
        some = np.flatnonzero(found.undecided & (found.members.place == place))
        gain[some] = gains_of(result.observations[place], result.adjusted.state, found.members.row[some])
    return gain
