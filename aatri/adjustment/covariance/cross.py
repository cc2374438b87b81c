"""Covariances between blocks of unknowns that share no front, by solves.

Marginal covariances come from one way down the tree. The covariance of a block b with any other is part of N^-1 E_b,
E_b the unit vectors of its scalars; that of many blocks with each other needs the first half of the solve only,

    Q = E'N^-1 E = U'U,    U = L^-1 E

Constraints and the inner constraints of a free datum take their share off, see `constrained` and `s_transformation`.
"""

from collections.abc import Sequence

import numpy as np

from aatri.adjustment.covariance.constrained import covariance_reduction, covariance_times
from aatri.adjustment.covariance.s_transformation import STransformation
from aatri.adjustment.elimination.right_hand_sides import forward, sides_of
from aatri.adjustment.stepping.adjusted import Adjusted, factor_of
from aatri.adjustment.stepping.robust import refuse_covariances
from aatri.arrays import Float, Int

Block = tuple[str, int]
"""Group and number of a block of unknowns."""


def covariances_of_pairs(adjusted: Adjusted, pairs: Sequence[tuple[Block, Block]]) -> list[Float]:
    """Covariance of each pair of blocks, a priori (sigma0 = 1): without the way down the whole tree.

    Parameters
    ----------
    pairs : sequence of ((group, block), (group, block))
        A solve for each block that is second in one of them.

    Returns
    -------
    list of (k, l) float64
        Zero for held scalars.
    """
    refuse_covariances(adjusted.down_weighted)
    problem, state = adjusted.problem, adjusted.state
    factored = factor_of(adjusted)
    W = covariance_reduction(problem, factored, state)
    covariance_of_pair: dict[int, Float] = {}
    for second in dict.fromkeys(second for _, second in pairs):
        firsts = {k: first for k, (first, other) in enumerate(pairs) if other == second}
        groups = {group for group, _ in firsts.values()}
        unit = _unit_vectors(adjusted, second[0], np.array([second[1]]))
        columns = covariance_times(problem, factored, state, W, {second[0]: unit}, groups)
        covariance_of_pair |= {k: columns[group][block] for k, (group, block) in firsts.items()}
    return [covariance_of_pair[k] for k in range(len(pairs))]


def joint_covariance(adjusted: Adjusted, group: str, blocks: Int, free_datum: STransformation | None = None) -> Float:
    """Covariance matrix of some blocks of a group of unknowns, a priori (sigma0 = 1).

    Parameters
    ----------
    blocks : (m,) int
        Numbers of blocks, each once.
    free_datum : STransformation, optional
        To the inner constraints of a free datum.

    Returns
    -------
    (m k, m k) float64
        Zero for held scalars; its diagonal blocks are the marginal covariances.
    """
    refuse_covariances(adjusted.down_weighted)
    problem, state = adjusted.problem, adjusted.state
    factored = factor_of(adjusted)
    unit = _unit_vectors(adjusted, group, blocks)
    Q = forward(problem, factored, state, sides_of(problem, {group: unit})).gram()
    constrained = covariance_reduction(problem, factored, state)
    if constrained:
        w = constrained[group][blocks].reshape(len(Q), -1)
        Q -= w @ w.T
    if free_datum is not None and group in free_datum.H:
        H, Z = (part[group][blocks].reshape(len(Q), -1) for part in (free_datum.H, free_datum.Z))
        mixed = H @ free_datum.M @ Z.T
        Q += H @ free_datum.inner @ H.T - mixed - mixed.T
    return np.asarray((Q + Q.T) / 2)


def _unit_vectors(adjusted: Adjusted, group: str, blocks: Int) -> Float:
    """Right-hand sides that ask for the columns of some blocks, (n, k, number of columns)."""
    n, size = next(u for u in adjusted.problem.unknowns if u.name == group).free.shape
    unit = np.zeros((n, size, len(blocks), size))
    unit[blocks, :, np.arange(len(blocks))] = np.eye(size)
    return unit.reshape(n, size, -1)
