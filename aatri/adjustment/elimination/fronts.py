"""Normalise while eliminating, front by front.

Each node's front receives the records and eliminated blocks that belong to it and the updates of its children; its
own unknowns are eliminated by a dense Cholesky factorisation, and what remains goes to its parent. Subtrees are
independent: they run in parallel, one BLAS thread each, and so do the levels above them. The top of the tree, where
fronts are large and fewer than threads, runs one after the other with all BLAS threads, on rays taken before. Sums have
one fixed order whatever the number of threads.

Held scalars have a unit row. Levenberg-Marquardt damping adds `damping` times the diagonal of the undamped matrix.
"""

from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from threading import Lock

import numpy as np

from aatri.adjustment.elimination import lapack
from aatri.adjustment.elimination.chunks import linearised, side_by_side
from aatri.adjustment.elimination.factor import LOST, Factor, Factored, without_factor
from aatri.adjustment.elimination.joint import joined
from aatri.adjustment.elimination.panels import panels_of
from aatri.adjustment.elimination.schedule import Schedule, Stretch, of_node
from aatri.adjustment.kernels.assemble import add_records, clear_lower, extend_add
from aatri.adjustment.kernels.eliminate import RANK_TOLERANCE, eliminate
from aatri.adjustment.records import excess, whitened
from aatri.adjustment.structure.index import KeptRecords
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.structure.tree import FrontNode
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float


def factorise(problem: IndexedProblem, state: State, damping: float = 0.0) -> Factored:
    """Linearise at a state, form and factorise the normal equations.

    Raises
    ------
    ResourceError
        If the problem is solved by conjugate gradients: there is no factor.
    """
    if problem.iterative is not None:
        raise without_factor(f", {problem.tree.factor_bytes / 1e9:.3g} GB")
    work = Work(problem, state, damping)
    Schedule.of(problem).up(work.assemble, work.finish)
    factored, others = work.result(), problem.settings.others
    return factored if others is None else joined(problem, factored, work.fronts[-1], others)


LARGEST_COPY = 2e8
"""Bytes of a front up to which threads may each have one of their own."""


LARGE_RECORD = 64
"""Rows of a record from which its products are formed by BLAS: another block's normal equations."""


def _add_large(
    chosen: Iterable[int], v: Float, A: Float, records: KeptRecords, state: State, front: tuple[Float, Float, Float]
) -> float:
    """`add_records` for records of very many rows that touch no unknown twice."""
    F, g, d = front
    p, total, own = records.parts, 0.0, records.records
    for r in chosen:
        used = np.flatnonzero(records.loc[r] >= 0)
        used = used[np.argsort(records.loc[r][used])]
        row = np.concatenate([records.loc[r, k] + np.arange(p.size[k]) for k in used])
        column = np.concatenate([p.start[k] + np.arange(p.size[k]) for k in used])
        if own.normal is None:
            J = A[r][:, column]
            N, right, cost, weight = J.T @ J, J.T @ v[r], float(v[r] @ v[r]), 1.0
        else:
            N, right, cost = own.normal(state)
            N, right, weight = N[np.ix_(column, column)], right[column], float(own.active[0] * own.whitener[0, 0] ** 2)
        F[np.ix_(row, row)] += weight * np.tril(N)  # the rows ascend, so that this is below the diagonal
        g[row] += weight * right
        d[row] += weight * np.diagonal(N)
        total += weight * cost
    return total


class _Room:
    """Memory of fronts that are done, for those to come: fresh memory costs as much as the work on a small front."""

    def __init__(self) -> None:
        self._spare: list[Float] = []
        self._turn = Lock()

    def take(self, n: int) -> Float:
        """A front of n rows, with anything in it, in the smallest memory that is large enough.

        Where none is, new memory takes the place of the largest that is spare.
        """
        with self._turn:
            self._spare.sort(key=len)
            fitting = next((k for k, spare in enumerate(self._spare) if len(spare) >= n * n), -1)
            memory = self._spare.pop(fitting) if self._spare else np.empty(0)
        if len(memory) < n * n:
            del memory
            memory = np.empty(n * n)
        return memory[: n * n].reshape((n, n), order="F")

    def give(self, front: Float) -> None:
        """Give back the memory of a front."""
        memory = front.base
        assert memory is not None
        with self._turn:
            self._spare.append(memory)


def own_normals(problem: IndexedProblem, state: State) -> tuple[Float, Float, float]:
    """D0 (n_blocks, 3, 3), h0 (n_blocks, 3) and the cost of the observations that touch eliminated blocks alone."""
    D0, h0, cost = problem.hold.copy(), np.zeros((len(problem.block_free), 3)), 0.0
    for records, rows, block in problem.direct:
        v, (J,) = whitened(records, state, rows)
        J = J * problem.block_free[block][:, None, :]
        np.add.at(D0, block, np.einsum("nki,nkj->nij", J, J))
        np.add.at(h0, block, np.einsum("nki,nk->ni", J, v))
        cost += float((v**2).sum()) + excess(records, v)
    return D0, h0, cost


class Work:
    """State of one factorisation; a node may be finished in any thread once its children are."""

    def __init__(self, problem: IndexedProblem, state: State, damping: float) -> None:
        self.problem, self.state, self.damping = problem, state, damping
        n_nodes, n_blocks = len(problem.tree.nodes), len(problem.block_free)
        self.panels = panels_of(problem.tree, problem.spill)
        self.y: list[Float] = [np.zeros(0)] * n_nodes
        self.fronts: list[tuple[Float, Float, Float] | None] = [None] * n_nodes
        self.room = _Room()
        self.cost = np.zeros(n_nodes + 1)
        self.weak: list[int] = [-1] * n_nodes
        self.lost = False
        self.diagonal = np.zeros(problem.layout.n_kept)
        self.block_factor, self.block_y = np.ones((n_blocks, 6)), np.zeros((n_blocks, 3))
        self.determined = np.ones(n_blocks)
        self.D0, self.h0, self.cost[-1] = own_normals(problem, state)
        self.fill = problem.ray_lane(state) if problem.rays is not None else None
        no_derivatives = np.zeros((0, 0)), np.zeros((0, 0, 0))
        self.kept = [
            (k, *(side_by_side(k, problem.layout, state) if k.records.normal is None else no_derivatives))
            for k in problem.kept
        ]
        self.cost[-1] += sum(excess(k.records, v) for k, v, _ in self.kept)

    def run(self, nodes: Iterable[int]) -> None:
        """Work on some nodes in their order."""
        for k in nodes:
            self.assemble(k)
            self.finish(k)

    def assemble(self, k: int, pool: ThreadPoolExecutor | None = None) -> None:
        """Start a front with its records and eliminated blocks, unless that has been done; in threads of `pool`."""
        if self.fronts[k] is not None:
            return
        node = self.problem.tree.nodes[k]
        F, g, d = self.room.take(node.size), np.zeros(node.size), np.zeros(node.size)
        clear_lower(F)
        for records, v, A in self.kept:
            first, last = int(records.first[k]), int(records.first[k + 1])
            if last > first:
                p = records.parts
                if records.records.rows < LARGE_RECORD and records.records.normal is None:
                    self.cost[k] += add_records(first, last, v, A, records.loc, p.size, p.start, F, g, d)
                else:
                    self.cost[k] += _add_large(range(first, last), v, A, records, self.state, (F, g, d))
        if self.problem.rays is not None:
            self._blocks(k, node, F, g, d, pool)
        is_fixed = self.problem.layout.fixed[node.columns]
        if is_fixed.any():
            F[is_fixed, :], F[:, is_fixed], g[is_fixed], d[is_fixed] = 0.0, 0.0, 0.0, 0.0
        self.fronts[k] = F, g, d

    def gather(self, k: int) -> tuple[Float, Float, Float]:
        """The front of a node with the updates of its children."""
        node, front = self.problem.tree.nodes[k], self.fronts[k]
        assert front is not None
        F, g, d = front
        for child in node.children:
            update = self.fronts[child]
            if update is not None:
                extend_add(*update, self.problem.tree.nodes[child].panel, self.problem.tree.maps[child], F, g, d)
                self.room.give(update[0])
            self.fronts[child] = None
        return front

    def finish(self, k: int) -> None:
        """Add the updates of the children and eliminate; the front stays for its parent."""
        node = self.problem.tree.nodes[k]
        n, m = node.size, node.panel
        F, g, d = self.gather(k)
        is_fixed = self.problem.layout.fixed[node.columns[:m]]
        i = np.arange(m)
        F[i, i] += np.where(is_fixed, 1.0, self.damping * d[:m])
        if m:
            self._eliminate(k, node, F, g, d, is_fixed)
        if n == m:
            self.room.give(F)
            self.fronts[k] = None

    def _eliminate(self, k: int, node: FrontNode, F: Float, g: Float, d: Float, is_fixed: Bool) -> None:
        m = node.panel
        info = lapack.cholesky_panel(F, m)
        pivot = np.diagonal(F)[:m] ** 2
        weak = np.flatnonzero(~is_fixed & ~(pivot > RANK_TOLERANCE * d[:m]))
        if info or len(weak):
            self.weak[k] = min([info - 1] * (info > 0) + weak[:1].tolist())
            if info or not (pivot[weak] > LOST * d[weak]).all():
                self.lost = True
        self.panels[k] = F[:, :m]
        self.diagonal[node.columns[:m]] = d[:m]
        lapack.forward(F[:, :m], g)
        self.y[k] = g[:m].copy()

    def _blocks(self, k: int, node: FrontNode, F: Float, g: Float, d: Float, pool: ThreadPoolExecutor | None) -> None:
        """Add the eliminated blocks of a node; those of one large front are shared out in fixed parts.

        Each stretch is summed on its own, in any thread, and the sums are added in their order.
        """
        of_this = of_node(self.problem, k)
        if len(of_this) < 2 or 8 * node.size**2 > LARGEST_COPY:
            for stretch in of_this:
                self.cost[k] += self._stretch(stretch, F, g, d)
            return

        def one(stretch: Stretch) -> tuple[float, Float, Float, Float]:
            own = np.zeros((node.size, node.size), order="F"), np.zeros(node.size), np.zeros(node.size)
            return self._stretch(stretch, *own), *own

        for cost, *own in pool.map(one, of_this) if pool is not None else map(one, of_this):
            self.cost[k] += cost
            with np.errstate(invalid="ignore"):  # above the diagonal of a front is whatever was in its memory
                for total, part in zip((F, g, d), own):
                    total += part

    def _stretch(self, stretch: Stretch, F: Float, g: Float, d: Float) -> float:
        rays = self.problem.rays
        assert rays is not None
        assert self.fill is not None
        own = (self.D0, self.h0, self.problem.block_free, self.damping)
        common = (*own, F, g, d, self.block_factor, self.block_y, self.determined)
        cost, parts = 0.0, rays.parts
        for p0, p1, v, A, B in linearised(self.problem, self.fill, stretch, masked=False):
            cost += excess(rays.records, v)
            base = int(rays.ray_start[p0])
            loc = rays.loc[base : int(rays.ray_start[p1])]
            cost += eliminate(p0, p1, base, rays.ray_start, v, A, B, loc, parts.size, parts.start, *common)
        return cost

    def result(self) -> Factored:
        """All that later steps need."""
        weak = [(k, row) for k, row in enumerate(self.weak) if row >= 0]
        factor, cost = Factor(self.panels), float(self.cost.sum())
        blocks = self.block_factor, self.block_y, self.determined
        return Factored(factor, self.y, *blocks, self.diagonal, weak, self.lost, cost, self.damping)
