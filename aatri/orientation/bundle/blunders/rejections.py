"""What a search decides at each step: which records go, of a point by all that touch it, within the room."""

from dataclasses import replace

import numpy as np

from aatri.adjustment.statistics.rejection import Pool, Snooping, clearest, pool_of, room_left
from aatri.arrays import Bool, Float, Int, finite_rows
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.image_points import KIND as IMAGE_POINT
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.blunders.all_records import AllRecords
from aatri.orientation.bundle.blunders.limits import DOUBT
from aatri.orientation.bundle.blunders.points import AtPoints, explained, with_start
from aatri.orientation.bundle.blunders.search_options import SearchOptions
from aatri.orientation.bundle.blunders.tested_block import TestedBlock, gains_of
from aatri.orientation.bundle.complete_start import robust_intersections
from aatri.orientation.bundle.result import BundleResult

MOST_ATTRIBUTIONS = 3

CAMERA_PASSES = 3
"""Intersections until rays of adjusted cameras meet: each leaves a tenth of the error where c is a tenth off."""

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
        How often least squares have been asked what is wrong at a point.
    doubtful : (n_points,) bool
        Points where nothing tells what is wrong, and it is small.
    kept : (n,) bool
        Records of which one is wrong there.
    """

    def __init__(self, block: BundleInput, options: SearchOptions) -> None:
        self.block, self.all = block, AllRecords.of(block)
        self.options = options = options.for_tests(self.all.tests)
        observed = [o.records for o in self.all.observed]
        self.snooping = Snooping(options.w_limit, (POINT,), ("", 1.0), CLEAR[options.method], 1.0)
        pool = pool_of(self.snooping, observed, [np.zeros(len(r.active)) for r in observed])
        self.pool: Pool = replace(pool, counted=self.all.native, variance=np.broadcast_to(0.0, len(self.all.native)))
        self.undecided = np.zeros(len(self.all.native), dtype=bool)
        self.attributions = np.zeros(len(block.point_ids), dtype=np.int64)
        self.doubtful = np.zeros(len(block.point_ids), dtype=bool)
        self.kept = np.zeros(len(self.all.native), dtype=bool)

    def next_rejections(self, tested: TestedBlock, use: Bool) -> Bool:
        """The clearest gross errors, at points by all records of the point."""
        picked = clearest(
            self.snooping, self.pool, tested.test, use, ~self._not_in_place_of_coordinates(tested.test, use)
        )
        at_points = picked & self.all.at_points
        points = np.unique(self.all.point[at_points])
        points = points[(self.attributions[points] < MOST_ATTRIBUTIONS) & ~self.doubtful[points]]
        self.attributions[points] += 1
        suspected = np.ones(len(points), dtype=bool)
        rejected = (
            self.gross_errors_at(tested.result, points, suspected, use, tested.test, tested.tails, move=False) & use
        )
        attributed = np.isin(self.all.point, np.unique(self.all.point[rejected]))
        attributed |= self.at_doubtful_points
        blamed = picked & ~(attributed & self.all.at_points)
        kept = self.within_room(rejected | blamed, use, tested.test)
        # Where the coordinates of a point may not go, its rays do not go in their stead.
        coordinates_kept = self.all.coordinates & (rejected | blamed) & ~kept
        return kept & ~self.at_points_of(np.unique(self.all.point[coordinates_kept]))

    def _not_in_place_of_coordinates(self, test: Float, use: Bool) -> Bool:
        """Records at points whose coordinates are the clearest there, and may not go: they do not go in their stead."""
        above_limit = use & self.all.coordinates & (test > self.options.w_limit)
        kept_coordinates = np.flatnonzero(above_limit & ~self.within_room(above_limit, use, test))
        largest = np.zeros(len(self.attributions))
        np.maximum.at(largest, self.all.point[kept_coordinates], test[kept_coordinates])
        return self.all.at_points & (test <= largest[np.maximum(self.all.point, 0)] + 1e-6)

    def gross_errors_at(
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
        has_start = np.isin(points, with_start(state[POINT], points))
        points, suspected = points[has_start], suspected[has_start]
        wrong = np.zeros(len(active), dtype=bool)
        if not len(points):
            return wrong
        of_image = self.all.image >= 0  # what images see that are not adjusted is no witness; a network has none
        usable = ~of_image
        usable[of_image] = result.image_adjusted[self.all.image[of_image]]
        native = self.all.split((self.all.native if move else active) & usable)
        limits = tuple(self.options.w_limit * kind_tails for kind_tails in self.all.split(tails))
        explanation: AtPoints = explained(self.all.observed, native, state, points, suspected, limits)
        if not move:
            explanation = explanation.decided_by_block(_gains(explanation, result))
        rows = self.all.first[explanation.members.place] + explanation.members.row
        largest, limit = np.zeros(len(points)), self.options.w_limit
        of_normal = np.where(active, np.nan_to_num(test * tails) - limit * (tails - 1.0), np.inf)
        np.maximum.at(largest, explanation.members.block, of_normal[rows])
        unclear = np.zeros(len(points), dtype=bool)
        unclear[explanation.members.block[explanation.undecided]] = True
        ambiguous = unclear & (largest <= max(DOUBT, limit))
        self.doubtful[points] = ambiguous
        certain = ~ambiguous[explanation.members.block]
        wrong[rows[explanation.out & certain]] = True
        self.undecided[rows], self.kept[rows] = explanation.undecided & certain, explanation.undecided & ~certain
        if move:
            xyz = self.block.xyz_m.copy()
            xyz[points] = explanation.xyz_m
            self.block = replace(self.block, xyz_m=xyz)
        return wrong

    def gross_errors_at_intersections(
        self, result: BundleResult, points: Int, active: Bool, test: Float, tails: Float
    ) -> Bool:
        """What is wrong at some points, (n,), of all records there, from where most of their rays meet."""
        xyz, no_suspects = self.robust_intersections(result, points), np.zeros(len(points), dtype=bool)
        return self.gross_errors_at(result, points, no_suspects, active, test, tails, move=True, xyz_m=xyz)

    def robust_intersections(self, result: BundleResult, points: Int) -> Float:
        """The points of a result, some of them where most of their rays meet: a wrong ray may have drawn them away."""
        xyz, rays = result.adjusted.state[POINT].copy(), self.block.rays
        if rays is not None:
            rays = replace(rays, active=rays.active & result.image_adjusted[rays.image])
            for k in range(CAMERA_PASSES if self.block.parameters else 1):
                rays = self._by_adjusted_cameras(rays, result, points, xyz) if k else rays
                met = robust_intersections(rays, result.adjusted.state[POSE], points, len(xyz))
                xyz = np.where(np.isfinite(met), met, xyz)
        return np.asarray(xyz)

    def _by_adjusted_cameras(
        self, rays: ImagePointRows, result: BundleResult, points: Int, xyz_m: Float
    ) -> ImagePointRows:
        """Image points as cameras of the stated principal distances without a lens would see them there.

        The residuals at points nearby are those of the adjusted cameras.
        """
        poses, (of_rays,) = result.adjusted.state[POSE], [o for o in self.all.observed if o.kind == IMAGE_POINT]
        rows = np.flatnonzero(rays.active & np.isin(rays.point, points) & finite_rows(xyz_m)[rays.point])
        u = np.einsum(
            "nji,nj->ni",
            poses.ground_from_image[rays.image[rows]],
            xyz_m[rays.point[rows]] - poses.position_m[rays.image[rows]],
        )
        rows, u = rows[u[:, 2] < 0], u[u[:, 2] < 0]
        residual_mm = of_rays.records.evaluate({**result.adjusted.state, POINT: xyz_m}, rows)[0]
        xy_mm = rays.xy_mm.copy()
        xy_mm[rows] = -rays.c_mm[rows, None] * u[:, :2] / u[:, 2:] - residual_mm
        return replace(rays, xy_mm=xy_mm)

    def within_room(self, wrong: Bool, active: Bool, test: Float) -> Bool:
        """Of what is wrong as much as there is room for in each kind, the clearest first."""
        kept, left = wrong.copy(), np.maximum(room_left(self.snooping, self.pool, active), 0)
        for limit, part in zip(left, self.all.parts):
            rows = np.flatnonzero(wrong[part] & self.pool.counted[part]) + part.start
            if len(rows) > limit:
                order = np.argsort(-np.nan_to_num(test[rows]), kind="stable")
                kept[rows[order[limit:]]] = False
        return kept

    @property
    def at_doubtful_points(self) -> Bool:
        """Records at points where nothing tells what is wrong, (n,)."""
        return self.all.at_points & self.doubtful[np.maximum(self.all.point, 0)]

    def at_points_of(self, points: Int) -> Bool:
        return self.all.at_points & np.isin(self.all.point, points)


def _gains(explanation: AtPoints, result: BundleResult) -> Float:
    """What leaving out each undecided member gains in the whole block, (r,); NaN for others."""
    gain = np.full(len(explanation.out), np.nan)
    for place in np.unique(explanation.members.place[explanation.undecided]).tolist():
        members = np.flatnonzero(explanation.undecided & (explanation.members.place == place))
        gain[members] = gains_of(result.observations[place], result.adjusted.state, explanation.members.row[members])
    return gain
