"""A search that does not have to live with the rejections of earlier stages: they may have blamed the wrong one.

A free strip or component is held by few control points and positions, and a wrong one bends it until a right one
disagrees. Where the search leaves something above the limit while an observation of the ground is out that an earlier
stage has rejected, it is made once more with all of these in use; it counts if it leaves less than half. So does a
search from least squares where one from a robust adjustment leaves too much: with little redundancy, few ties say, one
wrong control point outweighs all that disagrees with it.

Positions whose shift and drift they neglect outvote the one control point that is right. Where a block is open without
what earlier stages have rejected, what is observed of points comes back, and, where that is not enough, all else that
is no ray.

Correlated sets of which they have rejected a row, by neglecting the covariances, are asked again at once.

Searches made again ask for the same adjustments; one that has failed is not tried again (`failing_once`).
"""

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

from aatri.adjustment.statistics.global_test import sigma0_interval
from aatri.adjustment.statistics.limits import ALARM, MATTERS
from aatri.errors import AatriError, ConvergenceError, GeometryError
from aatri.observations.observed import Observed
from aatri.observations.poses import POINT
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.blunders.all_records import is_ray
from aatri.orientation.bundle.blunders.limits import MUCH_LESS
from aatri.orientation.bundle.blunders.robust import Adjust, AdjustOptions
from aatri.orientation.bundle.blunders.search import search
from aatri.orientation.bundle.blunders.search_options import SearchOptions
from aatri.orientation.bundle.blunders.tested_block import misfit
from aatri.orientation.bundle.result import BundleResult, from_result
from aatri.orientation.bundle.rounds import AdjustedBlock

T = TypeVar("T")


def with_datum_again(block: BundleInput, adjust: Callable[[BundleInput], T]) -> T:
    """Adjust a block, with rejections of earlier stages in use again where it is open without.

    Parameters
    ----------
    adjust : callable
        BundleInput -> the block adjusted.

    Raises
    ------
    GeometryError
        That of the block as it is, if it is open with them, too.
    """
    try:
        return adjust(block)
    except GeometryError as error:
        rejected = {o.kind for o in block.observed if _rejected(o)}
        of_points = {o.kind for o in block.observed if {group for group, _ in o.records.touches} == {POINT}}
        for kinds in (rejected & of_points, rejected):
            if kinds:
                observed = tuple(o.again() if o.kind in kinds else o for o in block.observed)
                try:
                    return adjust(replace(block, observed=observed))
                except GeometryError:
                    continue
        raise error


def with_sets_again(block: BundleInput) -> BundleInput:
    """The block with correlated sets in use of which an earlier stage has rejected a row: it tests them row by row."""
    return replace(block, observed=tuple(o.again() if o.components else o for o in block.observed))


def search_anew(
    block: BundleInput,
    adjust: Adjust,
    options: SearchOptions,
    tolerance: float,
    least_squares: list[BundleResult] | None,
) -> AdjustedBlock:
    """Search for gross errors, with and without what earlier stages have rejected of other kinds than rays.

    Parameters
    ----------
    block, adjust, options, tolerance, least_squares
        Of `search`.

    Raises
    ------
    GeometryError, ConvergenceError
        If the block cannot be adjusted.
    """
    done = search(block, adjust, options, tolerance, least_squares)

    def better(start: BundleInput, chosen: SearchOptions) -> AdjustedBlock:
        try:
            anew = search(start, adjust, chosen, tolerance)
        except (ConvergenceError, GeometryError):
            return done
        return (
            anew if misfit(anew.result, options.w_limit) <= MUCH_LESS * misfit(done.result, options.w_limit) else done
        )

    if done.above and any(map(_rejected, done.inputs.observed)) and any(map(_rejected, block.observed)):
        with_earlier = replace(block, observed=tuple(o.again() if _rejected(o) else o for o in block.observed))
        done = better(from_result(with_earlier, done.result), options)
    if options.method == "robust_snooping" and _contradicts(done):
        done = better(block, options.model_copy(update={"method": "data_snooping"}))
    return done


def _contradicts(done: AdjustedBlock) -> bool:
    """Whether something else than rays is above the limit, and sigma0 beyond what chance explains, and by much."""
    rays, adjusted = {o.kind for o in done.inputs.observed if is_ray(o)}, done.result.adjusted
    if adjusted.redundancy < 1 or all(kind in rays for kind, _ in done.above):
        return False
    return adjusted.sigma0 > max(sigma0_interval(adjusted.redundancy, ALARM)[1], MATTERS)


def _rejected(o: Observed) -> bool:
    return o.rejected is not None and bool(o.rejected.any()) and not is_ray(o)


def failing_once(adjust: Callable[..., BundleResult]) -> Callable[..., BundleResult]:
    """An adjustment by a block and, or not, `AdjustOptions`, that raises the error of before where it has failed.

    Coarse least squares that do not converge do not converge to their end, either. The blocks that failed are kept.
    """
    failures: list[tuple[BundleInput, AdjustOptions, AatriError]] = []

    def once(block: BundleInput, adjusting: AdjustOptions = AdjustOptions()) -> BundleResult:
        for before, weighted, error in failures:
            if before is not block or weighted.huber != adjusting.huber or weighted.weights is not adjusting.weights:
                continue
            diverges = isinstance(error, ConvergenceError) and adjusting.huber is None
            if weighted.coarse == adjusting.coarse or (weighted.coarse and diverges):
                raise error
        try:
            return adjust(block, adjusting)
        except (ConvergenceError, GeometryError) as error:
            failures.append((block, adjusting, error))
            raise

    return once
