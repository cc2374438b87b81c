"""Covariance of any two blocks of unknowns, or of a few with themselves, by solves.

Marginal covariances come from one way down the tree; the covariance of two blocks that share no front needs the columns
of one of them: N Q_.b = E_b for a kept block b. An eliminated block p, with D and C = E'A of its own observations, has

    Q_p. = -D^-1 C Q_x.,      Q_pq = -D^-1 C Q_xq    (p and q different)
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aatri.adjustment.covariance.constrained import covariance_reduction
from aatri.adjustment.elimination.backsolve import solve_columns
from aatri.adjustment.elimination.factor import Factored
from aatri.adjustment.elimination.fronts import factorise
from aatri.adjustment.records import whitened
from aatri.adjustment.stepping.adjusted import Adjusted
from aatri.adjustment.stepping.robust import refuse_covariances
from aatri.adjustment.structure.index import part_columns
from aatri.arrays import Float, Int

Block = tuple[str, int]
"""Group and number of a block of unknowns."""


def covariances_of_pairs(adjusted: Adjusted, pairs: Sequence[tuple[Block, Block]]) -> list[Float]:
    """Covariance of each pair of blocks, a priori (sigma0 = 1): without the way down the whole tree.

    Parameters
    ----------
    adjusted : Adjusted
    pairs : sequence of ((group, block), (group, block))
        One solve each, and one for all that follow each other with the same second block.

    Returns
    -------
    list of (k, l) float64
        Zero for held scalars.

    Raises
    ------
    ValueError
        If a pair is a block with itself that is eliminated: that has a term of its own, see `marginal`.
    """
    refuse_covariances(adjusted.down_weighted)
    problem = adjusted.problem
    factored = adjusted.factored or factorise(problem, adjusted.state)
    W = covariance_reduction(problem, factored, adjusted.state)
    found: list[Float] = []
    last: tuple[Block, Float] | None = None
    for first, second in pairs:
        if first == second and first[0] == problem.layout.eliminated:
            raise ValueError(f"{first} with itself: use marginal_covariances")
        columns = last[1] if last and last[0] == second else _columns_of(adjusted, factored, second)
        last = (second, columns)
        found.append(_rows_of(adjusted, factored, first, columns))
        if W:
            found[-1] -= W[first[0]][first[1]] @ W[second[0]][second[1]].T
    return found


def _columns_of(adjusted: Adjusted, factored: Factored, block: Block) -> Float:
    """Covariance of all kept unknowns with a block, (n_kept, k)."""
    problem = adjusted.problem
    kept, weights, _ = rows_in_kept(adjusted, factored, block)
    right = np.zeros((problem.layout.n_kept, weights.shape[0]))
    np.add.at(right, kept[kept >= 0], weights.T[kept >= 0])
    return solve_columns(problem, factored, right)


def _rows_of(adjusted: Adjusted, factored: Factored, block: Block, columns: Float) -> Float:
    kept, weights, _ = rows_in_kept(adjusted, factored, block)
    return np.asarray(weights[:, kept >= 0] @ columns[kept[kept >= 0]])


def rows_in_kept(adjusted: Adjusted, factored: Factored, block: Block) -> tuple[Int, Float, Float]:
    """A block of k unknowns as a linear function of the kept ones.

    Returns
    -------
    columns : (n,) int
        Of the kept unknowns; -1 where held.
    weights : (k, n) float64
    own : (k, k) float64
        Covariance that an eliminated block has beside: the inverse normal matrix of its own observations.
    """
    problem, (group, number) = adjusted.problem, block
    size = next(u.size for u in problem.unknowns if u.name == group)
    if group != problem.layout.eliminated or problem.layout.block[number] < 0:
        return problem.layout.columns(group, size)[number], np.eye(size), np.zeros((size, size))
    rays = problem.rays
    assert rays is not None
    p = int(np.flatnonzero(rays.block == number)[0])
    some = slice(int(rays.ray_start[p]), int(rays.ray_start[p + 1]))
    _, jacobians = whitened(rays.records, adjusted.state, rays.rows[some])
    touches = [g for g, _ in rays.records.touches]
    A = np.concatenate([J for g, J in zip(touches, jacobians) if g != group], axis=2)
    B = jacobians[touches.index(group)] * problem.block_free[p]
    columns = part_columns(rays.parts, problem.layout, some)
    C = np.einsum("nia,nib->bna", A, B).reshape(size, -1)
    L = np.zeros((3, 3))
    L[[0, 1, 2, 1, 2, 2], [0, 0, 0, 1, 1, 2]] = factored.block_factor[p]
    free = problem.block_free[p]
    inverse = np.linalg.solve(L.T, np.linalg.solve(L, np.eye(size))) * np.outer(free, free)
    return columns.ravel(), -inverse @ C, inverse
