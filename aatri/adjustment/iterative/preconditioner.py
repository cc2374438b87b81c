"""A factor of the reduced normal matrix that is cheaper than the exact one: exact below, block by block above.

Subtrees of the elimination tree that fit into memory are factorised as always. Of what they leave for the unknowns
above, T = S_ss - S_su S_uu^-1 S_us, only diagonal blocks are kept, pieces of the order of elimination. With the factor
L of the subtrees, the preconditioner is

    M = [L; S_su L^-T  I] diag(I, D) [L; S_su L^-T  I]',     D = diagonal blocks of T

positive definite, since T is, and equal to S where no node is above. Rays that belong to nodes above are eliminated
into one piece after the other, with the rest of their unknowns left out.

Source: Saad 2003, Iterative methods for sparse linear systems, ch. 14 (Schur complement, block Jacobi).
"""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np

from aatri.adjustment.elimination import lapack
from aatri.adjustment.elimination.chunks import linearised
from aatri.adjustment.elimination.factor import Factored
from aatri.adjustment.elimination.fronts import Work
from aatri.adjustment.elimination.panels import Panels, down_the_tree, up_the_tree
from aatri.adjustment.elimination.schedule import of_node
from aatri.adjustment.kernels.assemble import add_records
from aatri.adjustment.kernels.eliminate import RANK_TOLERANCE, eliminate
from aatri.adjustment.records import excess
from aatri.adjustment.structure.index import Parts
from aatri.adjustment.structure.indexed_problem import IndexedProblem, PartlyFactorised
from aatri.adjustment.structure.tree import Tree
from aatri.adjustment.threads import one_blas_thread, run_all
from aatri.adjustment.unknowns import State
from aatri.arrays import Float, Int, ranges

LEAST_PIECE, MOST_PIECE = 200, 2000
"""Unknowns of a piece; more where one vertex has more."""


@dataclass(frozen=True)
class Preconditioner:
    """The factor M."""

    problem: IndexedProblem
    below: tuple[int, ...]
    """Nodes of the subtrees, children before parents."""
    panels: Panels
    pieces: tuple[tuple[Int, Float], ...]
    """Tuple of (columns (m,), L (m, m)). Kept columns of each piece above, and its factor."""

    def solve(self, right: Float) -> Float:
        """M^-1 times a vector, (n_kept,)."""
        x, tree = right.copy(), self.problem.tree
        up_the_tree(tree, self.panels, x[:, None], self.below)
        for columns, L in self.pieces:
            part = x[columns]
            lapack.forward(L, part)
            lapack.backward(L, part)
            x[columns] = part
        down_the_tree(tree, self.panels, x[:, None], reversed(self.below))
        return x


def partly_factorised(problem: IndexedProblem, state: State, damping: float) -> tuple[Preconditioner, Factored]:
    """Linearise at a state, eliminate all blocks, and factorise the subtrees and pieces.

    Returns
    -------
    Factored
        Without the solution; `weak` names first pivots that are not positive.
    """
    work, subtrees = Work(problem, state, damping), _part(problem).subtrees
    with ThreadPoolExecutor(problem.threads) as pool, one_blas_thread():
        run_all(pool, [partial(work.run, nodes) for nodes in subtrees])
    below = sorted(k for nodes in subtrees for k in nodes)
    above = sorted(set(range(len(problem.tree.nodes))) - set(below))
    pieces = _Pieces(problem, above)
    for nodes in subtrees:
        pieces.take_update(work, nodes[-1])
    for k in above:
        pieces.take_records(work, k)
        pieces.take_rays(work, k)
    factors = pieces.factors(work)
    with_panel = tuple(k for k in below if problem.tree.nodes[k].panel)
    return Preconditioner(problem, with_panel, work.panels, factors), work.result()


def _part(problem: IndexedProblem) -> PartlyFactorised:
    assert problem.iterative is not None
    return problem.iterative


class _Pieces:
    """Diagonal blocks of the unknowns above, while they are summed up."""

    def __init__(self, problem: IndexedProblem, above: list[int]) -> None:
        self.problem = problem
        nodes, size = problem.tree.nodes, problem.layout.size
        own = [nodes[k].vertices[: nodes[k].own] for k in above]
        members = _cut(np.concatenate(own), size, _part(problem).piece) if own else []
        self.piece_of, self.row_of = np.full(len(size), -1), np.zeros(len(size), dtype=np.int64)
        self.columns: list[Int] = []
        self.sums: list[tuple[Float, Float, Float]] = []
        for q, part in enumerate(members):
            offset = np.cumsum(size[part]) - size[part]
            n = int(size[part].sum())
            self.piece_of[part], self.row_of[part] = q, offset
            self.columns.append(ranges(problem.layout.start[part], size[part]))
            self.sums.append((np.zeros((n, n), order="F"), np.zeros(n), np.zeros(n)))

    def take_update(self, work: Work, head: int) -> None:
        """Diagonal blocks of what a subtree leaves for the unknowns above."""
        node, front = self.problem.tree.nodes[head], work.fronts[head]
        work.fronts[head] = None
        if front is None:
            return
        size = np.diff(node.offset)[node.own :]
        vertex = np.repeat(node.vertices[node.own :], size)
        within = ranges(np.zeros_like(size), size)
        row = node.panel + np.arange(len(vertex))
        for q in np.unique(self.piece_of[vertex]):
            in_piece = self.piece_of[vertex] == q
            i, at = row[in_piece], (self.row_of[vertex] + within)[in_piece]
            F, _, d = self.sums[q]
            F[np.ix_(at, at)] += np.tril(front[0][np.ix_(i, i)])
            d[at] += front[2][i]

    def take_records(self, work: Work, k: int) -> None:
        """Records of kept unknowns that belong to a node above."""
        for records, v, A in work.kept:
            chunk = slice(int(records.first[k]), int(records.first[k + 1]))
            if chunk.start == chunk.stop:
                continue
            p = records.parts
            work.cost[k] += float((v[chunk] ** 2).sum())
            for loc, sums in self._one_after_the_other(p, chunk):
                add_records(0, len(loc), v[chunk], A[chunk], loc, p.size, p.start, *sums)

    def take_rays(self, work: Work, k: int) -> None:
        """Eliminate the blocks that belong to a node above."""
        rays = self.problem.rays
        if rays is None or work.fill is None:
            return
        p, results = rays.parts, (work.block_factor, work.block_y, work.determined)
        chunks = (one for part in of_node(self.problem, k) for one in linearised(self.problem, work.fill, part))
        for p0, p1, v, A, B in chunks:
            chunk = slice(int(rays.ray_start[p0]), int(rays.ray_start[p1]))
            work.cost[k] += float((v**2).sum()) + excess(rays.records, v)
            for loc, sums in self._one_after_the_other(p, chunk):
                rows = (p0, p1, chunk.start, rays.ray_start, v, A, B, loc, p.size, p.start)
                eliminate(*rows, work.D0, work.h0, self.problem.block_free, work.damping, *sums, *results)

    def _one_after_the_other(self, parts: Parts, rows: slice) -> Iterator[tuple[Int, tuple[Float, Float, Float]]]:
        """Rows of the parts in each piece that they meet, -1 in others, and its sums; at least one."""
        vertex = parts.vertex[rows]
        piece = np.where(vertex >= 0, self.piece_of[np.maximum(vertex, 0)], -1)
        row = self.row_of[np.maximum(vertex, 0)] + parts.shift
        pieces = np.unique(piece[piece >= 0])
        if not len(pieces):
            yield np.full(vertex.shape, -1, dtype=np.int32), (np.zeros((1, 1), order="F"), np.zeros(1), np.zeros(1))
        for q in pieces:
            yield np.where(piece == q, row, -1).astype(np.int32), self.sums[q]

    def factors(self, work: Work) -> tuple[tuple[Int, Float], ...]:
        """Columns and factor of each piece."""
        layout, tree = self.problem.layout, self.problem.tree
        for columns, (F, _, d) in zip(self.columns, self.sums):
            fixed, m = layout.fixed[columns], len(columns)
            i = np.arange(m)
            F[i, i] += np.where(fixed, 1.0, work.damping * d)
            work.diagonal[columns] = d
            info = lapack.cholesky_panel(F, m)
            bad = np.flatnonzero(~fixed & ~(np.diagonal(F) ** 2 > RANK_TOLERANCE * d))
            if info or len(bad):
                column = columns[min([info - 1] * (info > 0) + bad[:1].tolist())]
                k = int(tree.node_of[np.searchsorted(layout.start, column, side="right") - 1])
                work.weak[k] = int(np.flatnonzero(tree.nodes[k].columns == column)[0])
        return tuple(zip(self.columns, (F for F, _, _ in self.sums)))


def _cut(vertices: Int, size: Int, most: int) -> list[Int]:
    """Vertices in their order, in parts of at most `most` unknowns or one vertex."""
    parts: list[Int] = []
    first = total = 0
    for k, n in enumerate(size[vertices]):
        if total + n > most and k > first:
            parts.append(vertices[first:k])
            first, total = k, 0
        total += int(n)
    return [*parts, vertices[first:]] if len(vertices) else parts


def piece_within(n_kept: int, most_bytes: float) -> int:
    """Unknowns of a piece, so that all pieces fit."""
    return int(np.clip(most_bytes / (8.0 * max(n_kept, 1)), LEAST_PIECE, MOST_PIECE))


def subtrees_within(tree: Tree, most_bytes: float) -> tuple[tuple[int, ...], ...]:
    """The largest subtrees of about one size whose factors, and what they leave for those above, fit.

    Returns
    -------
    tuple of tuple of int
        Nodes of each subtree, children before parents.
    """
    nodes = tree.nodes
    rows, panel, parent = np.array([(node.size, node.panel, node.parent) for node in nodes]).T
    factor = 8.0 * rows * panel
    size = factor.copy()
    for k, node in enumerate(nodes):
        size[k] += size[list(node.children)].sum()
    inside = np.ones(len(nodes), dtype=bool)
    bound = size.max()
    while inside.any():
        head = inside & ((parent < 0) | ~inside[parent])
        if factor[inside].sum() + 8.0 * (rows[head] * (rows - panel)[head]).sum() <= most_bytes:
            break
        bound *= 0.8
        inside = size <= bound
    members: dict[int, list[int]] = {}
    top = np.arange(len(nodes))
    for k in reversed(np.flatnonzero(inside)):
        if not head[k]:
            top[k] = top[parent[k]]
        members.setdefault(int(top[k]), []).append(int(k))
    return tuple(tuple(reversed(members[k])) for k in sorted(members))
