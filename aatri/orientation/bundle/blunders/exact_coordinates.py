"""Exact values of points and images are tested too: they have no residual, and a wrong one bends the block unseen.

For the test they are observed with `SOFT_COORDINATE` of the standard deviation of new points, angles with its angle at
the distance of the images. That is small beside what the other observations say of them, so that |w| is nearly that of
the Lagrange multiplier of the condition that holds them,

    w = lambda / sigma_lambda,    sigma_lambda^2 = 1 / q,    q the variance of the coordinate without the condition

and the block is nearly the same.

Where all disagree they are not exact: what is gross must stand out of the others as well, by `scale_of` their tests.

Source: Teunissen 2000, Testing Theory, 3 (conditions as observations without variance).
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from aatri.adjustment.statistics.rejection import room_left
from aatri.arrays import Bool, Float, Int
from aatri.errors import ConvergenceError, GeometryError
from aatri.notes import Note
from aatri.observations.observed import Observed
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.blunders.all_records import AllRecords, is_of_image
from aatri.orientation.bundle.blunders.limits import MUCH_LESS, SOFT_COORDINATE, WORST_LEFT_OUT
from aatri.orientation.bundle.blunders.robust import Adjust, AdjustOptions
from aatri.orientation.bundle.blunders.robust_start import RobustStart
from aatri.orientation.bundle.blunders.search_notes import labels
from aatri.orientation.bundle.blunders.swaps import Swap
from aatri.orientation.bundle.blunders.tested_block import TestedBlock, misfit
from aatri.orientation.bundle.result import from_result
from aatri.orientation.bundle.seen_distances import median_distance_m

MEDIAN = 1.26
"""Median of the largest of three normal errors, of either sign."""


SearchEnd = tuple[TestedBlock, Bool, tuple[Swap, ...]]
"""What a search ends with: the block, what is active, exchanged numbers."""


class ExactCoordinates(RobustStart):
    """A search that knows exact coordinates."""

    def without_far_exact(self, start: TestedBlock, active: Bool) -> tuple[TestedBlock, Bool]:
        """Least squares without the exact coordinates that are most of what is above the limit, and what is active.

        A far one bends all rays: standard deviations that fit with it are so large that nothing is wrong any more.
        """
        limit = self.options.w_limit
        if not any(map(is_testable, self.all.observed)):
            return start, active
        while start.result.adjusted.has_factor and misfit(start.result, limit) > 0:
            test = tests_of_exact(start, self.all, self.adjust)
            worst = np.argsort(-np.nan_to_num(test))[:WORST_LEFT_OUT]
            room = room_left(self.snooping, self.pool, active)[self.pool.source]
            trials = [self._without(start, active, row) for row in worst[(test[worst] > limit) & (room[worst] > 0)]]
            best = min(filter(None, trials), key=lambda trial: trial.result.adjusted.cost, default=None)
            if best is None or misfit(best.result, limit) > MUCH_LESS * misfit(start.result, limit):
                break
            start, active = best, best.active
        return start, active

    def _without(self, tested: TestedBlock, active: Bool, row: int) -> TestedBlock | None:
        """Least squares without one more record; None where that fails."""
        use = active.copy()
        use[row] = False
        try:
            return self.solve(tested, use)
        except (GeometryError, ConvergenceError):
            return None

    def without_wrong_exact(
        self, searched: SearchEnd, search: Callable[[list[TestedBlock], Bool], SearchEnd], rejected: Int
    ) -> tuple[SearchEnd, Bool]:
        """Search on without the exact coordinates that contradict the block; also what does and stays, (n,).

        One after the other goes, the worst first. What then is not clear of the others comes back: they are not exact.

        Parameters
        ----------
        rejected : (k,) int
            Those that are out already.
        """
        limit, wrong = self.options.w_limit, np.zeros_like(searched[1])
        if not any(map(is_testable, self.all.observed)):
            return searched, wrong
        while searched[0].result.adjusted.has_factor:
            tested, use, swapped = searched
            test = tests_of_exact(tested, self.all, self.adjust)
            wrong = test > limit
            largest = int(np.nanargmax(test)) if wrong.any() else -1
            if largest < 0 or room_left(self.snooping, self.pool, use)[self.pool.source[largest]] < 1:
                unclear = rejected[tested.test[rejected] <= limit * scale_of(test)]
                if len(unclear):
                    use = use.copy()
                    use[unclear], wrong[unclear] = True, True
                    searched = self.solve(tested, use), use, swapped
                break
            reduced = self._without(tested, use, largest)
            if reduced is None:
                break
            try:
                searched = search([self._with_fitting_sigmas(reduced)], reduced.active)
            except (GeometryError, ConvergenceError):
                break
            if searched[1][largest]:
                break
            rejected = np.append(rejected, largest)
        return searched, wrong & searched[1]


def tests_of_exact(tested: TestedBlock, records: AllRecords, adjust: Adjust) -> Float:
    """Tests of the records in use that are held exactly, (n,); NaN for all others.

    Parameters
    ----------
    tested : TestedBlock
        Adjusted, with covariances.
    """
    block = from_result(tested.block, tested.result)
    observed = exact_as_observed(block, tested.result.point_covariance_m2)
    if observed is None:
        return np.full(len(records.native), np.nan)
    soft = replace(tested, result=adjust(replace(block, observed=observed), AdjustOptions(coarse=True)))
    exact = np.concatenate([np.full(len(o), is_testable(o)) for o in block.observed])
    return np.where(exact & tested.active, soft.test, np.nan)


def is_testable(o: Observed) -> bool:
    """Whether some of these are exact and yet cells of a table, which may be wrong: no conditions."""
    return o.holds is not None or (o.exact and is_of_image(o))


def exact_as_observed(block: BundleInput, point_covariance_m2: Float) -> tuple[Observed, ...] | None:
    """The observations with exact values as observed ones, so that they have tests; None where there are none.

    Parameters
    ----------
    point_covariance_m2 : (p, 3, 3) float64, m^2
        Of all points, with the exact coordinates held.
    """
    variance = np.diagonal(point_covariance_m2, axis1=1, axis2=2)
    new = np.isfinite(variance).all(axis=1) & (variance > 0).all(axis=1)
    if not new.any() or not any(map(is_testable, block.observed)):
        return None
    sigma_m = SOFT_COORDINATE * float(np.sqrt(np.median(variance[new])))
    distance_m = median_distance_m(block.rays, block.poses, block.xyz_m)  # 0: there are no rays to test angles by
    sigma_rad = sigma_m / distance_m if distance_m else 0.0
    return tuple(softened(o, sigma_rad if o.unit == "rad" else sigma_m) for o in block.observed)


def scale_of(test: Float) -> float:
    """Scale of some tests, each the largest of a record's three components, robustly; 1 and more."""
    finite = test[np.isfinite(test)]
    return max(1.0, float(np.median(finite)) / MEDIAN) if len(finite) else 1.0


def exact_notes(records: AllRecords, wrong: Bool) -> list[Note]:
    """Exact coordinates that contradict the block and stay."""
    return [
        Note(
            "warning",
            f"{o.kind}: exact values contradict the block by more than chance explains, and are used; if they are "
            "not exact, give their standard deviations",
            labels(o, part),
        )
        for o, part in zip(records.observed, records.split(wrong))
        if part.any()
    ]


def softened(o: Observed, sigma: float) -> Observed:
    """Exact coordinates or angles as observed ones, so that they have residuals; `sigma` in m, of angles in rad."""
    if not is_testable(o) or not sigma > 0:
        return o
    if o.holds is None:
        return replace(o, records=replace(o.records, whitener=o.records.whitener / sigma), exact=False)
    whitener = o.records.whitener if o.records.whitener.ndim == 3 else o.records.whitener[:, :, None] * np.eye(3)
    whitener = whitener.copy()
    row, component = np.nonzero(o.holds.scalar)
    whitener[row, component, component] = 1.0 / sigma
    return replace(o, records=replace(o.records, whitener=whitener), holds=None)
