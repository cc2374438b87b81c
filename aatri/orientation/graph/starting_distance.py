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

import numpy as np

from aatri.arrays import Float, Int
from aatri.orientation.graph.free_images import averaged
from aatri.orientation.graph.limits import FEWEST_IN_TRIANGLES, FITTING_ROTATIONS_RAD, LEFT_BY_DISTANCE
from aatri.orientation.graph.pair_graph import PairGraph, RotationPairs

FACTORS = np.exp(0.05 * np.arange(-10, 11))
"""Factors that are tried, from 0.61 to 1.65: twice as wide apart rotations of an orbit may miss the right one."""

HALVINGS = 2
"""Of the step between them, towards the best: 1.3 % in the end, from which a bundle begins."""


def rotation_misfit(graph: PairGraph, turns: RotationPairs) -> float:
    """What averaged rotations leave of those of pairs, rad; infinite where too few lie in triangles."""
    _, error, triangles = averaged(graph, turns)
    checked = error[(triangles > 0) & np.isfinite(error)]
    return float(np.quantile(checked, 0.75)) if len(checked) >= FEWEST_IN_TRIANGLES else float("inf")


def starting_factor(misfit: Callable[[float], float]) -> float:
    """The factor on a principal distance with which rotations of pairs fit each other; 1 where the stated one does.

    Parameters
    ----------
    misfit : callable
        Factor -> misfit of the rotations, times the factor, rad.
    """
    stated = misfit(1.0)
    if stated <= FITTING_ROTATIONS_RAD or not np.isfinite(stated):
        return 1.0
    misfits = {1.0: stated, **{f: misfit(f) for f in FACTORS.tolist() if abs(f - 1.0) > 1e-9}}
    step = float(np.log(FACTORS[1] / FACTORS[0]))
    for _ in range(HALVINGS):
        step /= 2
        best = min(misfits, key=misfits.__getitem__)
        misfits |= {f: misfit(f) for f in (best * float(np.exp(-step)), best * float(np.exp(step)))}
    best = min(misfits, key=misfits.__getitem__)
    return best if misfits[best] < LEFT_BY_DISTANCE * stated else 1.0


def near_images(left: Int, right: Int, images: int, most_pairs: int) -> Int:
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
