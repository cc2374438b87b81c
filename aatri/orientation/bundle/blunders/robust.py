"""A robust adjustment of a block: every kind of observation counts by its weight function; priors and exact ones fully.

Huber's loss, of the length of a record's whitened residual, is minimised by itself (`aatri.adjustment.loss`). With the
other weight functions, of the record's largest component, which have several minima, it is the start; then each
adjustment takes the weights of the residuals before, until they stay.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from aatri.adjusting.adjusted_observations import AdjustedObservations
from aatri.adjustment.records import predicted
from aatri.adjustment.statistics.attribution import CONTROLLED
from aatri.adjustment.statistics.weight_functions import weights
from aatri.arrays import Float
from aatri.notes import Note
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.blunders.search_options import SearchOptions
from aatri.orientation.bundle.result import BundleResult, from_result
from aatri.orientation.bundle.rounds import AdjustedBlock, with_readmission

ROUNDS = 40

STAYS = 0.01
"""Largest change of a weight, as a share of it, that counts no more."""


@dataclass(frozen=True)
class AdjustOptions:
    """One adjustment on the way."""

    huber: float | None = None
    """Bound of Huber's loss of all kinds."""
    weights: tuple[Float, ...] = ()
    """Tuple of (n,). Of all records, kind by kind; empty: 1."""
    coarse: bool = False
    """It need not converge to the end."""
    covariances: bool = True
    """With standard deviations, where these are wanted at all."""


Adjust = Callable[[BundleInput, AdjustOptions], BundleResult]


def robustly(block: BundleInput, adjust: Adjust, options: SearchOptions) -> AdjustedBlock:
    """A robust adjustment for its own sake: nothing is rejected, and there are no statistics."""
    least_squares = adjust(block, AdjustOptions(coarse=True)) if options.weights == "li_posterior" else None
    start = block if least_squares is None else from_result(block, least_squares)
    done = with_readmission(
        start, lambda start_block: robust(start_block, adjust, options, least_squares, coarse=False)
    )
    return replace(done, notes=(*done.notes, *_down_weighted(done.result, options.weights, options.k)))


def robust(
    block: BundleInput, adjust: Adjust, options: SearchOptions, least_squares: BundleResult | None, *, coarse: bool
) -> BundleResult:
    """Adjust robustly.

    Parameters
    ----------
    adjust : callable
    least_squares : BundleResult or None
        The adjustment by least squares with its covariances, for the redundancy numbers that Li's function asks for;
        without it they count as 1.
    coarse : bool
        It need not converge to the end.
    """
    if options.weights == "huber":
        return adjust(block, AdjustOptions(huber=options.k, coarse=coarse))
    result = adjust(block, AdjustOptions(huber=options.k, coarse=True))
    previous: tuple[Float, ...] = ()
    for _ in range(ROUNDS):
        current = tuple(_weights(o, result, options, least_squares, i) for i, o in enumerate(result.observations))
        converged = bool(previous) and all(
            (np.abs(a - b) <= STAYS * np.maximum(a, 0.01)).all() for a, b in zip(current, previous)
        )
        result = adjust(from_result(block, result), AdjustOptions(weights=current, coarse=coarse or not converged))
        if converged:
            break
        previous = current
    return result


def _weights(
    observations: AdjustedObservations,
    result: BundleResult,
    options: SearchOptions,
    least_squares: BundleResult | None,
    i: int,
) -> Float:
    o, rows = observations.observed, np.flatnonzero(observations.used)
    weight = np.ones(len(o))
    if not (o.components or o.exact or not len(rows)):
        v = np.where(o.records.observed_components()[rows], predicted(o.records, result.adjusted.state, rows)[0], 0.0)
        size = np.abs(v).max(axis=1)
        if options.weights == "li_posterior" and least_squares is not None:
            r = 1.0 - np.einsum("nii->ni", least_squares.observations[i].covariance[rows])
            size = np.abs(v / np.sqrt(np.where(r > CONTROLLED, r, 1.0))).max(axis=1)
        weight[rows] = weights(options.weights, size, options.k)
    return weight


def _down_weighted(result: BundleResult, weighting: str, bound: float) -> list[Note]:
    """How many observations a robust adjustment has weighted down, and what it cannot give."""
    count, used = result.adjusted.down_weighted, sum(int(o.used.sum()) for o in result.observations)
    notes = [Note("note", f"{count} of {used} observations are weighted down ({weighting}, bound {bound:g} sigma)")]
    if count:
        text = (
            "not a least-squares solution: it has neither sigma0 nor standard deviations; a bundle with "
            "`blunders: robust_snooping` that starts from this one gives them"
        )
        notes.append(Note("warning", text))
    return notes
