"""A robust adjustment before anything is rejected by least squares, where gross errors smear.

It begins where least squares have come to; where something is very far off also at the start, with weights that let
nothing so far off pull (`robust.robust_from_start`), and that result counts of which less is to be rejected.
Each point with something above the limit, or rejected by an earlier stage, is looked at from the robust poses, held
(`points`): the fewest records are left out without which the others agree. Of other kinds what is above the limit goes;
where a kind has more of it than there is room for, and all else agrees without this kind and only so, the kind goes.
The limit is that of normal errors: gross errors smear here too, and seem long tails. The least squares that follow tell
the tails, and take back single observations that these explain.
"""

import contextlib
from dataclasses import replace

import numpy as np

from aatri.adjustment.statistics.rejection import room_left
from aatri.arrays import Bool, Float
from aatri.errors import ConvergenceError, GeometryError
from aatri.observations.poses import POINT
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.blunders.all_records import is_ray
from aatri.orientation.bundle.blunders.fitted_sigmas import MOST_SCALINGS, FittedSigmas
from aatri.orientation.bundle.blunders.limits import ASTRAY, FAR_TOO_EXACT
from aatri.orientation.bundle.blunders.robust import (
    Adjust,
    AdjustOptions,
    robust,
    robust_from_start,
    standardised,
    usual_size,
)
from aatri.orientation.bundle.blunders.search_options import SearchOptions
from aatri.orientation.bundle.blunders.swaps import exchanged_coordinates
from aatri.orientation.bundle.blunders.tested_block import TestedBlock, least_squares_covariance, tests_of
from aatri.orientation.bundle.result import BundleResult, from_result, held_for_datum


class RobustStart(FittedSigmas):
    """A search that begins with a robust adjustment.

    Attributes
    ----------
    rejected_kinds : (n,) bool
        Records of kinds that were left out as a whole.
    """

    def __init__(self, block: BundleInput, adjust: Adjust, options: SearchOptions, tolerance: float) -> None:
        super().__init__(block, adjust, options, tolerance)
        self.rejected_kinds = np.zeros(len(self.all.native), dtype=bool)

    def _active_after_robust(self, active: Bool, initial: TestedBlock | None) -> Bool:
        """What is active after a robust adjustment; the block starts from there."""
        moved = self.block if initial is None else self._start_from(initial, active)
        result = self._robust_from(moved, initial, active)
        least_squares, tested = self._least_squares_beside(result, initial, active), initial
        for _ in range(MOST_SCALINGS if self.options.sigmas != "given" else 0):
            if not self._takes_image_apart(result, least_squares):
                scales = self.scaling.classes.scales(result, least_squares)
                scaling, factor = self._scaling_after(scales, tested, FAR_TOO_EXACT)
                self._rescale(scaling, factor, from_result(self.block, result))
                if (factor == 1.0).all():
                    break
            tested = self._initial_least_squares(active)
            result = self._robust_from(self.block, tested, active)
            least_squares = self._least_squares_beside(result, tested, active)
        state = result.adjusted.state
        # what least squares followed, so that nothing controlled it there, may be far off here: at least |v|
        test = np.fmax(*(self._robust_tests(result, covariances) for covariances in (least_squares, None)))
        above_limit = active & (test > self.options.w_limit)
        self.block = from_result(self.block, result)
        without_point = above_limit & ~self.all.at_points
        points = np.unique(self.all.point[(above_limit | (self.all.native & ~active)) & self.all.at_points])
        gross_errors_at = self.gross_errors_at_intersections(
            result, points, active, test, np.broadcast_to(1.0, len(test))
        )
        exchanged = exchanged_coordinates(
            self.all.observed, self.all.split(active & gross_errors_at), state, self.block.xyz_m
        )
        self.pool = replace(self.pool, counted=self.pool.counted & ~np.concatenate(exchanged))
        wrong = active & (gross_errors_at | without_point)
        rejected_kind = self._kind_to_reject(wrong, active, held_for_datum(result))
        if rejected_kind is not None:
            wrong[rejected_kind] = active[rejected_kind]
            self.rejected_kinds[rejected_kind] = True
            self.pool = replace(self.pool, counted=self.pool.counted & ~self.rejected_kinds)
        rejected = self.within_room(wrong, active, test)
        # where a wrong ray stays for want of room, none comes back against it, and the point stays where it was
        crowded = np.unique(self.all.point[wrong & ~rejected & self.all.at_points])
        stays = np.isin(np.arange(len(self.block.xyz_m)), crowded) & result.point_adjusted
        self.block = replace(self.block, xyz_m=np.where(stays[:, None], state[POINT], self.block.xyz_m))
        readmitted = self.all.native & self.at_points_of(np.setdiff1d(points, crowded)) & ~gross_errors_at
        return (active | readmitted) & ~rejected

    def _robust_from(self, start: BundleInput, initial: TestedBlock | None, active: Bool) -> BundleResult:
        """The robust adjustment from a start by least squares; or from the block, if gross errors have led them astray.

        Where something is very far off it is done from both, and that counts which leaves less to reject.
        """
        as_given, least_squares = self.block, None if initial is None else initial.result
        ends = list[tuple[BundleInput, BundleResult]]()
        with contextlib.suppress(ConvergenceError, GeometryError):
            ends.append((start, self._robust(start, least_squares)))
        if initial is None or (active & (initial.test > ASTRAY * self.options.w_limit)).any():
            with contextlib.suppress(ConvergenceError, GeometryError):
                ends.append((as_given, robust_from_start(as_given, self.adjust)))
        if not ends:
            return self._robust(as_given, least_squares)
        scales = np.min([_scales(result) for _, result in ends], axis=0)
        self.block, result = min(ends, key=lambda end: self._truncated_squares(end[1], scales))
        return result

    def _least_squares_beside(
        self, result: BundleResult, tested: TestedBlock | None, active: Bool
    ) -> BundleResult | None:
        """The least squares whose covariances tell how well a robust adjustment fits; None where they fail.

        Where they fail with everything, or something is very far off that may have led them astray, they begin at the
        robust result, without that.
        """
        near = active & ~(self._robust_tests(result, None) > ASTRAY * self.options.w_limit)
        if tested is not None and (near == active).all():
            return tested.result
        block = from_result(self.block, result)
        block = replace(block, observed=self.all.without(block.observed, near))
        with contextlib.suppress(ConvergenceError, GeometryError):
            return self.adjust(block, AdjustOptions(coarse=True))
        return None

    @staticmethod
    def _robust_tests(result: BundleResult, least_squares: BundleResult | None) -> Float:
        """Tests at a robust adjustment, with the covariances of least squares; without these |v|."""
        return np.concatenate(
            [
                tests_of(replace(o, covariance=least_squares_covariance(o, least_squares, i)), result.adjusted.state)
                for i, o in enumerate(result.observations)
            ]
        )

    def _truncated_squares(self, result: BundleResult, scales: Float) -> float:
        """Sum of the squares of the residuals of all records over their scales, of each at most that of the limit."""
        most = self.options.w_limit**2
        squares = [(v**2).sum(axis=1) / scale**2 for v, scale in zip(_residuals(result), scales)]
        return sum(float(np.minimum(each, most).sum()) for each in squares)

    def _robust(self, start: BundleInput, least_squares: BundleResult | None) -> BundleResult:
        return robust(start, self.adjust, self.options, least_squares, coarse=True)

    def _kind_to_reject(self, wrong: Bool, active: Bool, held_scalars: int) -> slice | None:
        """A kind with more wrong than there is room for, where the rest agrees without it, and only without it.

        What alone tells a part of the datum, of which `held_scalars` are held with it, has no rest to disagree with.
        """
        room, counted = room_left(self.snooping, self.pool, active), self.pool.counted
        parts = [p for p, o in zip(self.all.parts, self.all.observed) if not is_ray(o) and active[p].any()]
        overfull_parts = [
            p for k, p in enumerate(self.all.parts) if np.count_nonzero((wrong & counted)[p]) > max(room[k], 0)
        ]
        if len(overfull_parts) != 1 or overfull_parts[0] not in parts:
            return None
        other_parts = [p for p in parts if p != overfull_parts[0]]
        return (
            overfull_parts[0]
            if self._agrees(wrong, active, overfull_parts[0], overfull_parts[0], held_scalars)
            and not any(self._agrees(wrong, active, overfull_parts[0], p, held_scalars) for p in other_parts)
            else None
        )

    def _agrees(self, wrong: Bool, active: Bool, overfull: slice, left_out: slice, held_scalars: int) -> bool:
        """Whether the block agrees without one kind; `overfull` is that with too many wrong ones."""
        use = active & ~wrong
        use[overfull] = active[overfull]
        use[left_out] = False
        try:
            tested = self.solve(None, use)
        except (GeometryError, ConvergenceError):
            return False
        return held_for_datum(tested.result) <= held_scalars and not self._is_harmful(tested, use)

    def _start_from(self, initial: TestedBlock, active: Bool) -> BundleInput:
        """The block from where least squares has moved it; points with something above the limit may have run away."""
        above_limit = active & self.all.at_points & ~(initial.test <= self.options.w_limit)
        points = np.unique(self.all.point[above_limit])
        moved = from_result(self.block, initial.result)
        xyz = moved.xyz_m.copy()
        xyz[points] = self.block.xyz_m[points]
        return replace(moved, xyz_m=xyz)


def _residuals(result: BundleResult) -> list[Float]:
    """Whitened residuals of what is used, kind by kind, (n, m)."""
    state = result.adjusted.state
    return [standardised(o.observed, state, np.flatnonzero(o.used)) for o in result.observations]


def _scales(result: BundleResult) -> Float:
    """Usual sizes of the residuals, kind by kind, in standard deviations."""
    return np.array([usual_size(np.abs(v).max(axis=1, initial=0.0)) for v in _residuals(result)])
