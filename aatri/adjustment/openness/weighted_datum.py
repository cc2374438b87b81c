"""A datum that observations of little weight hold: determined, however small its pivots are beside those of the rays.

Rays do not see a motion of the whole block. Its share of the normal matrix is that of the observations of the datum
alone, and falls with the square of their standard deviations: control of 1 m in an object of 8 m whose image points
measure 2 mm has 4e-12 of what thousands of rays put on the diagonal. Such a pivot says how much the datum weighs beside
the rays, not that it is open; what the observations see of a motion whatever their weight says that
(`unseen_motions`). The datum is used as it is, as long as rounding leaves the pivots (`LOST`).
"""

from collections.abc import Sequence

import numpy as np

from aatri.adjustment.elimination.factor import Factored
from aatri.adjustment.kernels.eliminate import RANK_TOLERANCE
from aatri.adjustment.openness.limits import MOTION_IF_NEARLY
from aatri.adjustment.openness.motions import open_motions
from aatri.adjustment.openness.nearly_open import leading
from aatri.adjustment.openness.open_directions import OpenCombination
from aatri.adjustment.openness.unseen_motions import unseen_motions
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.threads import one_blas_thread
from aatri.adjustment.unknowns import State


def is_singular(problem: IndexedProblem, state: State, factored: Factored) -> bool:
    """Whether pivots vanish, but for those of a datum that observations see with little weight."""
    if (factored.determined == 0).any():
        return True
    return bool(factored.weak) and not _only_weighs_little(problem, state, factored)


def _only_weighs_little(problem: IndexedProblem, state: State, factored: Factored) -> bool:
    """Whether all directions below the rank tolerance are motions of the whole block, and observations see each."""
    if factored.lost or not factored.factor.is_direct or factored.joint is not None:
        return False
    D = np.sqrt(np.where(factored.diagonal > 0, factored.diagonal, 1.0))
    with one_blas_thread():
        values, U = leading(problem, factored, D, 0.0)
    below = values * RANK_TOLERANCE > 1.0
    motions, rest = open_motions(problem, state, U[:, below], factored.diagonal, common=MOTION_IF_NEARLY)
    return not rest.shape[1] and are_seen_motions(problem, state, motions)


def are_seen_motions(problem: IndexedProblem, state: State, combinations: Sequence[OpenCombination]) -> bool:
    """Whether combinations are motions of the whole block, which no other unknown takes up, and observations see each.

    An offset of all observed heights takes up a shift: the heights see the shift, but not both.
    """
    are_motions = bool(combinations) and all(one.of_whole and not one.unknowns for one in combinations)
    return are_motions and not unseen_motions(problem, state)
