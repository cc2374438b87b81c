"""A robust adjustment of a block: every kind of observation counts by its weight function; priors and exact ones fully.

Huber's loss, of the length of a record's whitened residual, is minimised by itself (`aatri.adjustment.loss`). With the
other weight functions, of the record's largest component, which have several minima, it is the start; then each
adjustment takes the weights of the residuals before, until they stay.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from aatri.adjusting.adjusted_observations import AdjustedObservations
from aatri.adjustment.records import whitened_residuals
from aatri.adjustment.statistics.limits import CONTROLLED_COMPONENT, MEDIAN_OF_NORMAL
from aatri.adjustment.statistics.weight_functions import BOUNDS, weights
from aatri.adjustment.unknowns import State
from aatri.arrays import Float, Int
from aatri.notes import Note
from aatri.observations.observed import Observed
from aatri.orientation.bundle.block import BundleInput, start_of
from aatri.orientation.bundle.blunders.search_options import SearchOptions
from aatri.orientation.bundle.result import BundleResult, from_result
from aatri.orientation.bundle.rounds import AdjustedBlock, with_readmission

ROUNDS, FEW_ROUNDS = 40, 3
"""Adjustments with the weights of the one before, at most: until these stay; to choose what to begin with."""

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
    to_end_if_near: bool = False
    """Coarse, but to the end where one or two steps lead there: where nothing is rejected it is the result."""
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
    least_squares : BundleResult or None
        The adjustment by least squares with its covariances, for the redundancy numbers that Li's function asks for;
        without it they count as 1.
    coarse : bool
        It need not converge to the end.
    """
    if options.weights == "huber":
        return adjust(block, AdjustOptions(huber=options.k, coarse=coarse))
    result = adjust(block, AdjustOptions(huber=options.k, coarse=True))
    return _reweighted(block, adjust, options, least_squares, result, coarse=coarse)


def robust_from_start(block: BundleInput, adjust: Adjust) -> BundleResult:
    """Adjust robustly from a start that is nearly right, with Cauchy's weights of the residuals there.

    Huber's loss lets a single ray far off turn an image whose other rays it outweighs; these weights do not. What the
    start is off, and standard deviations that are too small, widen their bound: k times the median residual of a kind
    over that of normal errors.
    """
    state = start_of(block)
    current = [_widened(o, state, np.flatnonzero(o.records.active), np.ones(len(o))) for o in block.observed]
    result = adjust(block, AdjustOptions(weights=tuple(current), coarse=True))
    for _ in range(FEW_ROUNDS):
        state = result.adjusted.state
        each = zip(result.observations, current)
        current = [_widened(o.observed, state, np.flatnonzero(o.used), before) for o, before in each]
        result = adjust(from_result(block, result), AdjustOptions(weights=tuple(current), coarse=True))
    return result


def _widened(o: Observed, state: State, rows: Int, before: Float) -> Float:
    """Cauchy's weights of the rows by their size over the usual one; other records keep those of before, (n,)."""
    weight = before.copy()
    if not (o.components or o.exact or not len(rows)):
        size = np.abs(standardised(o, state, rows)).max(axis=1)
        weight[rows] = np.where(np.isfinite(size), weights("cauchy", size / usual_size(size), BOUNDS["cauchy"]), 1.0)
    return weight


def usual_size(size: Float) -> float:
    """Median of the sizes of whitened residuals, (n,), over that of normal errors, at least 1; 1 without any."""
    return max(float(np.nanmedian(size)) / MEDIAN_OF_NORMAL, 1.0) if np.isfinite(size).any() else 1.0


def _reweighted(
    block: BundleInput,
    adjust: Adjust,
    options: SearchOptions,
    least_squares: BundleResult | None,
    result: BundleResult,
    *,
    coarse: bool,
) -> BundleResult:
    """Adjusted with the weights of the residuals before, again and again."""
    previous = tuple(np.ones(len(o.observed)) for o in result.observations)
    for _ in range(ROUNDS):
        current = tuple(
            _weights(o, result, options, least_squares, i, before)
            for i, (o, before) in enumerate(zip(result.observations, previous))
        )
        converged = all((np.abs(a - b) <= STAYS * np.maximum(a, 0.01)).all() for a, b in zip(current, previous))
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
    before: Float,
) -> Float:
    """Weights of one of the observations; what the adjustment lost with a point far off keeps that of before."""
    o, rows = observations.observed, np.flatnonzero(observations.used)
    weight = before.copy()
    if not (o.components or o.exact or not len(rows)):
        v = standardised(o, result.adjusted.state, rows)
        if options.weights == "li_posterior" and least_squares is not None:
            r = 1.0 - np.einsum("nii->ni", least_squares.observations[i].covariance[rows])
            v = v / np.sqrt(np.where(r > CONTROLLED_COMPONENT, r, 1.0))
        weight[rows] = weights(options.weights, np.abs(v).max(axis=1), options.k)
    return weight


def standardised(o: Observed, state: State, rows: Int) -> Float:
    """Residuals of some records in units of their standard deviations, zero where nothing is observed, (k, m)."""
    return np.where(o.records.observed_components()[rows], whitened_residuals(o.records, state, rows), 0.0)


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
