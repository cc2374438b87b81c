"""A block whose search for gross errors fails, although least squares of all its observations fits them.

Without some observations, or by other weights, weak points may run away, and with them the search. Nothing calls for
rejections where sigma0 of least squares is not above what chance explains: that result stands, and a warning says that
nothing was searched for. Where sigma0 is larger the failure stands.
"""

from dataclasses import replace

from aatri.adjustment.statistics.global_test import sigma0_interval
from aatri.errors import AatriError, ConvergenceError, GeometryError
from aatri.notes import Note
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.blunders.robust import Adjust, AdjustOptions
from aatri.orientation.bundle.rounds import AdjustedBlock, with_readmission


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
