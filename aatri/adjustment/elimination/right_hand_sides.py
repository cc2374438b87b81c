"""Several right-hand sides to one factorisation, over all unknowns, the eliminated ones too.

The normal matrix is N = L L', eliminated blocks first. With the 3x3 factor L_p of a block and its part E_p = B'A with
the kept unknowns, N Z = R goes in two steps,

    U = L^-1 R:    U_p = L_p^-1 R_p,              U_x = L_x^-1 (R_x - sum E_p' L_p^-T U_p)
    Z = L^-T U:    Z_x = L_x^-T U_x,              Z_p = L_p^-T (U_p - L_p^-1 E_p Z_x)

The first step touches only blocks and fronts with a right-hand side below them; U'U = R'N^-1 R needs no more than it.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from aatri.adjustment.elimination.chunks import over_rays
from aatri.adjustment.elimination.factor import Factored
from aatri.adjustment.elimination.panels import down_the_tree, up_the_tree
from aatri.adjustment.kernels.back_substitution import substitute
from aatri.adjustment.records import whitened
from aatri.adjustment.structure.index import EliminatedRecords, part_columns
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.threads import one_blas_thread
from aatri.adjustment.unknowns import State
from aatri.arrays import Float, Int, ranges

RAYS = 100_000
"""Rays whose parts E are in memory at a time: some 0.1 GB."""


@dataclass(frozen=True)
class Sides:
    """m right-hand sides R, or U = L^-1 R."""

    kept: Float
    """(n_kept, m). Zero for held scalars."""
    block: Int
    """(k,) int64. Eliminated blocks that are not zero, ascending, by their place among the rays' blocks."""
    of_block: Float
    """(k, 3, m)."""

    def gram(self) -> Float:
        """Products of all pairs of columns, (m, m)."""
        flat = self.of_block.reshape(-1, self.kept.shape[1])
        return np.asarray(self.kept.T @ self.kept + flat.T @ flat)


def sides_of(problem: IndexedProblem, groups: Mapping[str, Float]) -> Sides:
    """Right-hand sides from their blocks by group, (n, k, m) each; what is held counts as zero.

    Parameters
    ----------
    groups : mapping
        Groups that are missing are zero.
    """
    m = next(iter(groups.values())).shape[2]
    kept = np.zeros((problem.layout.n_kept, m))
    block, of_block = np.zeros(0, dtype=np.int64), np.zeros((0, 3, m))
    for u in problem.unknowns:
        if u.name not in groups:
            continue
        columns = problem.layout.columns(u.name, u.size)
        kept[columns[columns >= 0]] = groups[u.name][columns >= 0]
        if u.eliminated and problem.rays is not None:
            inner = groups[u.name][problem.rays.block] * problem.block_free[:, :, None]
            block = np.flatnonzero(inner.any(axis=(1, 2)))
            of_block = inner[block]
    return Sides(kept, block, of_block)


def forward(problem: IndexedProblem, factored: Factored, state: State, right: Sides) -> Sides:
    """U = L^-1 R."""
    x, of_block = without_blocks(problem, factored, state, right)
    with one_blas_thread():  # a few columns are not worth a second thread
        up_the_tree(problem.tree, factored.factor.all_panels, x)
    return Sides(x, right.block, of_block)


def without_blocks(problem: IndexedProblem, factored: Factored, state: State, right: Sides) -> tuple[Float, Float]:
    """R_x - sum E_p' L_p^-T U_p and U_p: what the eliminated blocks leave of right-hand sides, and take up of them."""
    x, of_block = right.kept.copy(), right.of_block
    if len(right.block):
        inverse = inverse_factors(factored.block_factor[right.block])
        of_block = inverse @ of_block
        _subtract_blocks(problem, state, right.block, inverse.swapaxes(1, 2) @ of_block, x)
    return x, of_block


def backward(
    problem: IndexedProblem, factored: Factored, state: State, u: Sides, of_groups: Collection[str] | None = None
) -> dict[str, Float]:
    """Z = L^-T U by group and block, (n, k, m) each; zero for held scalars. `of_groups` are the groups, or all."""
    x = u.kept.copy()
    with one_blas_thread():
        down_the_tree(problem.tree, factored.factor.all_panels, x)
    x[problem.layout.fixed] = 0.0
    padded = np.vstack([x, np.zeros((1, x.shape[1]))])
    solution: dict[str, Float] = {}
    for unknowns in (one for one in problem.unknowns if of_groups is None or one.name in of_groups):
        columns = problem.layout.columns(unknowns.name, unknowns.size)
        solution[unknowns.name] = np.where(columns[:, :, None] >= 0, padded[columns], 0.0)
    if problem.rays is not None and len(problem.rays.block) and problem.layout.eliminated in solution:
        solution[problem.layout.eliminated][problem.rays.block] = _blocks_back(problem, factored, state, u, x)
    return solution


def inverse_factors(factor: Float) -> Float:
    """L^-1 of the 3x3 factors of eliminated blocks, (k, 6) -> (k, 3, 3)."""
    L = np.zeros((len(factor), 3, 3))
    L[:, [0, 1, 2, 1, 2, 2], [0, 0, 0, 1, 1, 2]] = factor
    return np.asarray(np.linalg.inv(L))


def _subtract_blocks(problem: IndexedProblem, state: State, block: Int, w: Float, x: Float) -> None:
    """x -= sum E_p' w_p over some eliminated blocks, w (k, 3, m), by pieces of not many more rays than `RAYS`."""
    rays = problem.rays
    assert rays is not None
    before = np.cumsum(rays.ray_start[block + 1] - rays.ray_start[block])
    edges = np.searchsorted(before, np.arange(RAYS, before[-1], RAYS))
    for piece, w_of_piece in zip(np.split(block, edges), np.split(w, edges)):
        _subtract_piece(problem, rays, state, piece, w_of_piece, x)


def _subtract_piece(
    problem: IndexedProblem, rays: EliminatedRecords, state: State, block: Int, w: Float, x: Float
) -> None:
    count = rays.ray_start[block + 1] - rays.ray_start[block]
    place = np.repeat(np.arange(len(block)), count)
    ray = ranges(rays.ray_start[block], count)
    _, jacobians = whitened(rays.records, state, rays.rows[ray])
    touches = [group for group, _ in rays.records.touches]
    B = jacobians[touches.index(problem.layout.eliminated)] * problem.block_free[block[place]][:, None, :]
    A = np.concatenate([J for g, J in zip(touches, jacobians) if g != problem.layout.eliminated], axis=2)
    columns = part_columns(rays.parts, problem.layout, ray)
    row = np.broadcast_to(columns[:, :, None], (*columns.shape, 3))
    column = np.broadcast_to(3 * place[:, None, None] + np.arange(3), row.shape)
    free = row >= 0
    shape = len(x), 3 * len(block)
    E = csr_array(((A.swapaxes(1, 2) @ B)[free], (row[free], column[free])), shape=shape)
    x -= (E @ csr_array(w.reshape(-1, w.shape[2]))).toarray()  # a side has few of the blocks


def _blocks_back(problem: IndexedProblem, factored: Factored, state: State, u: Sides, x: Float) -> Float:
    """Z of the eliminated blocks, (n_blocks, 3, m): each linearisation serves all columns."""
    rays = problem.rays
    assert rays is not None
    m = x.shape[1]
    right = np.zeros((m, len(rays.block), 3))
    right[:, u.block] = -np.moveaxis(u.of_block, 2, 0)
    solution, columns = np.zeros_like(right), np.ascontiguousarray(x.T)
    fill, parts = problem.ray_lane(state), rays.parts

    def one(_: int, p0: int, p1: int, _v: Float, A: Float, B: Float) -> None:  # x is zero where held
        base, last = int(rays.ray_start[p0]), int(rays.ray_start[p1])
        rows = (p0, p1, base, rays.ray_start, A, B, problem.ray_columns[base:last], parts.size, parts.start)
        for j in range(m):
            substitute(*rows, columns[j], problem.block_free, factored.block_factor, right[j], solution[j])

    over_rays(problem, fill, one)
    return np.moveaxis(solution, 0, 2)
