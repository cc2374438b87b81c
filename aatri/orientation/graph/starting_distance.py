"""A start of principal distances from the rotations of pairs.

With a principal distance that is wrong by a factor each pair of convergent images turns a little too much or too
little, so that around loops of images the rotations R_right = R_left R_pair no longer agree. What averaged rotations
leave of them is least at the right one:

    misfit(f) = f times the 75 % quantile of |log(R_left R_pair(f c) R_right')| over the pairs that lie in triangles

f, as the same error in an image turns its rays by less with a longer principal distance. Factors of up to 5/3 are
tried, and what stands against the stated one must be clear. Parallel views of flat ground tell nothing, and change
nothing.

Source: Sweeney et al., ICCV 2015 (the viewing graph); Pan et al., ECCV 2024, 3.1 (calibration of the view graph).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from aatri.arrays import Float, Int
from aatri.orientation.graph.free_images import averaged
from aatri.orientation.graph.limits import FEWEST_IN_TRIANGLES, FITTING_ROTATIONS_RAD, LEFT_BY_DISTANCE
from aatri.orientation.graph.pair_graph import PairGraph, RotationPairs

FACTORS = np.exp(0.05 * np.arange(-10, 11))
"""Factors that are tried, from 0.61 to 1.65: twice as wide apart rotations of an orbit may miss the right one."""

HALVINGS = 2
"""Of the step between them, towards the best: 1.3 % in the end, from which a bundle begins."""


@dataclass(frozen=True)
class StartingFactor:
    """The factor on a principal distance with which rotations of pairs fit each other."""

    factor: float
    """1 where the stated one does, or nothing tells."""
    stated_rad: float
    misfit_rad: float
    """75 % of the rotations of pairs fit within these, with the stated principal distance and with this one."""


def rotation_errors(graph: PairGraph, turns: RotationPairs) -> Float:
    """What averaged rotations leave of those of pairs that lie in triangles, (k,), rad."""
    _, error, triangles = averaged(graph, turns)
    return np.asarray(error[(triangles > 0) & np.isfinite(error)])


def starting_factor(errors_of: Callable[[float], Float]) -> StartingFactor:
    """The factor on a principal distance with which rotations of pairs fit each other.

    Parameters
    ----------
    errors_of : callable
        Factor -> what averaged rotations leave of those of pairs in triangles, (k,), rad.
    """
    errors = errors_of(1.0)
    pairs, stated = len(errors), _misfit(errors, len(errors))
    if pairs < FEWEST_IN_TRIANGLES or stated <= FITTING_ROTATIONS_RAD:
        return StartingFactor(1.0, stated, stated)
    misfits = {1.0: stated}
    misfits |= {f: f * _misfit(errors_of(f), pairs) for f in FACTORS.tolist() if abs(f - 1.0) > 1e-9}
    best = min(misfits, key=misfits.__getitem__)
    if best in (FACTORS[0], FACTORS[-1]):  # there it is not least
        return StartingFactor(1.0, stated, stated)
    step = float(np.log(FACTORS[1] / FACTORS[0]))
    for _ in range(HALVINGS):
        step /= 2
        near = (best * float(np.exp(-step)), best * float(np.exp(step)))
        misfits |= {f: f * _misfit(errors_of(f), pairs) for f in near}
        best = min(misfits, key=misfits.__getitem__)
    clear = misfits[best] < LEFT_BY_DISTANCE * stated
    return StartingFactor(best, stated, misfits[best] / best) if clear else StartingFactor(1.0, stated, stated)


def _misfit(errors: Float, pairs: int) -> float:
    """75 % quantile of the errors of so many pairs; those that form no model, or lie in no triangle, do not fit."""
    place = int(np.ceil(0.75 * max(pairs, len(errors)))) - 1
    return float(np.sort(errors)[place]) if 0 <= place < len(errors) else float("inf")


def pairs_around_one_image(left: Int, right: Int, images: int, most_pairs: int) -> Int:
    """Pairs of images that hang together, at most so many about, (k,): those around the image of most pairs."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import breadth_first_order

    if len(left) <= most_pairs:
        return np.arange(len(left))
    joined = coo_array((np.ones(len(left)), (left, right)), shape=(images, images))
    first = int(np.bincount(np.concatenate([left, right]), minlength=images).argmax())
    reached = breadth_first_order(joined.tocsr(), first, directed=False, return_predecessors=False)
    place: Float = np.full(images, np.inf)
    place[reached] = np.arange(len(reached))
    return np.sort(np.argsort(np.maximum(place[left], place[right]), kind="stable")[:most_pairs])
