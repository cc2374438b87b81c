"""A block whose search for gross errors fails, although least squares of all its observations fits them.

Without some observations, or by other weights, weak points may run away, and with them the search. Nothing calls for
rejections where sigma0 of least squares is not above what chance explains: that result stands, and a warning says that
nothing was searched for. Where sigma0 is larger the failure stands.

The steps of a search ask for the same adjustment several times; one that fails is not tried again (`failing_once`).
"""

from dataclasses import replace

from aatri.adjustment.statistics.global_test import sigma0_interval
from aatri.errors import AatriError, ConvergenceError, GeometryError
from aatri.notes import Note
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.blunders.robust import Adjust, AdjustOptions
from aatri.orientation.bundle.result import BundleResult
from aatri.orientation.bundle.rounds import AdjustedBlock, with_readmission


def failing_once(adjust: Adjust) -> Adjust:
    """The same adjustment, which raises the error of a block that has failed before without adjusting it again.

    A coarse adjustment that fails fails to its end, too.
    """
    failures: list[tuple[BundleInput, AdjustOptions, AatriError]] = []

    def once(block: BundleInput, adjusting: AdjustOptions = AdjustOptions()) -> BundleResult:
        for before, weighted, error in failures:
            same_weights = weighted.huber == adjusting.huber and weighted.weights is adjusting.weights
            if before is block and same_weights and (weighted.coarse or not adjusting.coarse):
                raise error
        try:
            return adjust(block, adjusting)
        except (ConvergenceError, GeometryError) as error:
            failures.append((block, adjusting, error))
            raise

    return once


def without_search(block: BundleInput, adjust: Adjust, failure: AatriError) -> AdjustedBlock:
    """Least squares with all observations where these fit, after a search that failed.

    Parameters
    ----------
    failure : AatriError
        Of the search.

    Raises
    ------
    AatriError
        The failure of the search, where least squares fails too or does not fit.
    """
    try:
        done = with_readmission(block, lambda inputs: adjust(inputs, AdjustOptions()))
    except (ConvergenceError, GeometryError):
        raise failure from None
    redundancy, sigma0 = done.result.adjusted.redundancy, done.result.adjusted.sigma0
    if redundancy < 1 or not sigma0 <= sigma0_interval(redundancy)[1]:
        raise failure
    text = (
        f"gross errors were not searched for: the search failed ({failure.what}); least squares of all observations "
        f"fits with sigma0 {sigma0:.3g}, and is the result; `blunders: none` asks for it at once"
    )
    return replace(done, notes=(*done.notes, Note("warning", text)))
