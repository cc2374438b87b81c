"""Normalise while eliminating, front by front.

Each node's front receives the records and eliminated blocks that belong to it and the updates of its children; its
own unknowns are eliminated by a dense Cholesky factorisation, and what remains goes to its parent. Subtrees are
independent: they run in parallel, one BLAS thread each, and so do the levels above them. The top of the tree, where
fronts are large and fewer than threads, runs one after the other with all BLAS threads, on rays taken before. Sums have
one fixed order whatever the number of threads.

Held scalars have a unit row. Levenberg-Marquardt damping adds `damping` times the diagonal of the undamped matrix.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cached_property, partial
from threading import Lock

import numpy as np
import numpy.typing as npt

from aatri.adjustment import lapack
from aatri.adjustment.index import KeptRecords, Parts, Rays, part_columns
from aatri.adjustment.kernels.assemble import add_records, clear_lower, extend_add
from aatri.adjustment.kernels.eliminate import RANK_TOLERANCE, eliminate
from aatri.adjustment.kernels.eliminate_pose import eliminate_pose
from aatri.adjustment.layout import Layout
from aatri.adjustment.panels import Panels, panels_of
from aatri.adjustment.records import Fill, Records, excess, in_order, whitened
from aatri.adjustment.threads import run_all, thread_control
from aatri.adjustment.tree import Node, Tree
from aatri.adjustment.unknowns import State, Unknowns
from aatri.errors import ResourceError

Float = npt.NDArray[np.float64]
Int = npt.NDArray[np.integer]

CHUNK = 4096
"""Rays linearised at once: their Jacobians stay in the cache."""

THREADED_FLOPS = 5e8
"""Fronts with more work than this are factorised by several BLAS threads."""

RAY_FLOPS = 10000.0
"""Work of one ray against that of the factorisation, for sharing out the subtrees."""

PARALLEL_FLOPS = 1e9
"""Problems with less work than this run in one thread: others would mostly wait."""


@dataclass(frozen=True)
class Problem:
    """An adjustment problem with its index: made once, used in every iteration.

    Attributes
    ----------
    unknowns, records
    layout : Layout
    tree : Tree
    rays : Rays or None
    kept : tuple of KeptRecords
    direct : tuple of (Records, rows (n,), block in order (n,))
        Records that touch one eliminated block and nothing else.
    block_free : (n_blocks, 3) float64
        1 where a scalar of an eliminated block is free, in the order of the rays' blocks.
    threads : int
    reproducible : bool
        The same bits for any number of threads: one BLAS thread throughout.
    hold : (n_blocks, 3, 3) float64
        Added to the normal matrix of an eliminated block without an observation: zero but for blocks that have no
        finite optimum, whose steps it shortens.
    constraints : tuple of Records
        What must hold exactly; see `constraints`.
    spill : bool
        The panels of the factor go to a file.
    subtrees : tuple of tuple of int, optional
        Solve by conjugate gradients, with these subtrees factorised (`preconditioner`).
    piece : int
        Then: how many of the other unknowns are factorised together, at most.
    """

    unknowns: tuple[Unknowns, ...]
    records: tuple[Records, ...]
    layout: Layout
    tree: Tree
    rays: Rays | None
    kept: tuple[KeptRecords, ...]
    direct: tuple[tuple[Records, Int, Int], ...]
    block_free: Float
    threads: int
    reproducible: bool
    hold: Float
    constraints: tuple[Records, ...] = ()
    spill: bool = False
    subtrees: tuple[tuple[int, ...], ...] | None = None
    piece: int = 0

    @cached_property
    def ray_lane(self) -> Callable[[State], Fill]:
        """The rays' observation type in the order of the rays."""
        assert self.rays is not None
        return in_order(self.rays.records, self.rays.rows)

    @cached_property
    def ray_columns(self) -> Int:
        """First kept column of each part of each ray, (n, parts); -1 where it is held."""
        assert self.rays is not None
        parts = self.rays.parts
        return np.append(self.layout.start[:-1], -1)[parts.vertex] + np.where(parts.vertex >= 0, parts.shift, 0)


@dataclass
class Factored:
    """A factorised linearisation.

    Attributes
    ----------
    panels : Panels of (n, m) float64
        L11 and L21 of each node.
    y : list of (m,) float64
        Forward-substituted gradient of each node.
    block_factor, block_y : (n_blocks, 6), (n_blocks, 3) float64
    determined : (n_blocks,) float64
        0 where an eliminated block is not determined.
    diagonal : (n_kept,) float64
        Diagonal of A'A.
    weak : list of (node, row)
        First pivot of each front that is not positive.
    cost : float
    damping : float
    multiplier, violation : (m,) float64
        Of the constraints, if any.
    solution : (n_kept,) float64, optional
        Of the kept unknowns, where it was found without a factor.
    """

    panels: Panels
    y: list[Float]
    block_factor: Float
    block_y: Float
    determined: Float
    diagonal: Float
    weak: list[tuple[int, int]]
    cost: float
    damping: float
    multiplier: Float = field(default_factory=lambda: np.zeros(0))
    violation: Float = field(default_factory=lambda: np.zeros(0))
    solution: Float | None = None

    @property
    def decrease(self) -> float:
        """Decrease of the cost by the linear model but for the damping: the Newton decrement squared."""
        return float(sum(y @ y for y in self.y) + (self.block_y**2).sum())


def factorise(problem: Problem, state: State, damping: float = 0.0) -> Factored:
    """Linearise at a state, form and factorise the normal equations.

    Raises
    ------
    ResourceError
        If the problem is solved by conjugate gradients: there is no factor.
    """
    if problem.subtrees is not None:
        raise ResourceError(
            f"exact covariances need the factor of the normal equations, {problem.tree.factor_bytes / 1e9:.3g} GB, and "
            "this block is solved by conjugate gradients, without it",
            remedy="raise memory_gb, or give more disk to TMPDIR",
        )
    work = Work(problem, state, damping)
    subtrees, levels = share_out(problem)
    if len(subtrees) < 2:
        with thread_control().limit(limits=1, user_api="blas"):
            work.run(range(len(problem.tree.nodes)))
        return work.result()
    few = [k for level in levels if len(level) < problem.threads for k in level]
    with ThreadPoolExecutor(problem.threads) as pool, thread_control().limit(limits=1, user_api="blas"):
        # where threads will be idle later, the rays are taken now
        run_all(pool, [partial(work.run, nodes) for nodes in subtrees] + [partial(work.assemble, k) for k in few])
        for level in levels:
            if len(level) >= problem.threads:
                run_all(pool, [partial(work.run, [k]) for k in level])
                continue
            with thread_control().limit(limits=blas_threads(problem, level), user_api="blas"):
                work.run(level)
    return work.result()


def blas_threads(problem: Problem, nodes: Sequence[int]) -> int:
    """BLAS threads for some fronts: one unless a front is large enough to gain from more."""
    largest = max((problem.tree.nodes[k].flops for k in nodes), default=0.0)
    return problem.threads if largest > THREADED_FLOPS and not problem.reproducible else 1


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


class Work:
    """State of one factorisation; a node may be finished in any thread once its children are."""

    def __init__(self, problem: Problem, state: State, damping: float) -> None:
        self.problem, self.damping = problem, damping
        n_nodes, n_blocks = len(problem.tree.nodes), len(problem.block_free)
        self.panels = panels_of(problem.tree, problem.spill)
        self.y: list[Float] = [np.zeros(0)] * n_nodes
        self.fronts: list[tuple[Float, Float, Float] | None] = [None] * n_nodes
        self.room = _Room()
        self.cost = np.zeros(n_nodes + 1)
        self.weak: list[int] = [-1] * n_nodes
        self.diagonal = np.zeros(problem.layout.n_kept)
        self.block_factor, self.block_y = np.ones((n_blocks, 6)), np.zeros((n_blocks, 3))
        self.determined = np.ones(n_blocks)
        self.D0, self.h0 = problem.hold.copy(), np.zeros((n_blocks, 3))
        self._direct(state)
        self.fill = problem.ray_lane(state) if problem.rays is not None else None
        self.kept = [(k, *side_by_side(k, problem.layout, state)) for k in problem.kept]
        self.cost[-1] += sum(excess(k.records, v) for k, v, _ in self.kept)

    def _direct(self, state: State) -> None:
        for records, rows, block in self.problem.direct:
            v, (J,) = whitened(records, state, rows)
            J = J * self.problem.block_free[block][:, None, :]
            np.add.at(self.D0, block, np.einsum("nki,nkj->nij", J, J))
            np.add.at(self.h0, block, np.einsum("nki,nk->ni", J, v))
            self.cost[-1] += float((v**2).sum()) + excess(records, v)

    def run(self, nodes: Iterable[int]) -> None:
        """Work on some nodes in their order."""
        for k in nodes:
            self.assemble(k)
            self.finish(k)

    def assemble(self, k: int) -> None:
        """Start a front with its records and eliminated blocks, unless that has been done."""
        if self.fronts[k] is not None:
            return
        node = self.problem.tree.nodes[k]
        F, g, d = self.room.take(node.size), np.zeros(node.size), np.zeros(node.size)
        clear_lower(F)
        for records, v, A in self.kept:
            first, last = int(records.first[k]), int(records.first[k + 1])
            if last > first:
                p = records.parts
                self.cost[k] += add_records(first, last, v, A, records.loc, p.size, p.start, F, g, d)
        if self.problem.rays is not None:
            self._blocks(k, node, F, g, d)
        self.fronts[k] = F, g, d

    def finish(self, k: int) -> None:
        """Add the updates of the children and eliminate; the front stays for its parent."""
        node, front = self.problem.tree.nodes[k], self.fronts[k]
        assert front is not None
        n, m = node.size, node.panel
        F, g, d = front
        for child in node.children:
            update = self.fronts[child]
            if update is not None:
                extend_add(*update, self.problem.tree.nodes[child].panel, self.problem.tree.maps[child], F, g, d)
                self.room.give(update[0])
            self.fronts[child] = None
        held = self.problem.layout.held[node.columns[:m]]
        i = np.arange(m)
        F[i, i] += np.where(held, 1.0, self.damping * d[:m])
        if m:
            self._eliminate(k, node, F, g, d, held)
        if n == m:
            self.room.give(F)
            self.fronts[k] = None

    def _eliminate(self, k: int, node: Node, F: Float, g: Float, d: Float, held: npt.NDArray[np.bool_]) -> None:
        m = node.panel
        info = lapack.cholesky_panel(F, m)
        pivot = np.diagonal(F)[:m] ** 2
        weak = np.flatnonzero(~held & ~(pivot > RANK_TOLERANCE * d[:m]))
        if info or len(weak):
            self.weak[k] = min([info - 1] * (info > 0) + weak[:1].tolist())
        self.panels[k] = F[:, :m]
        self.diagonal[node.columns[:m]] = d[:m]
        lapack.forward(F[:, :m], g)
        self.y[k] = g[:m].copy()

    def _blocks(self, k: int, node: Node, F: Float, g: Float, d: Float) -> None:
        rays = self.problem.rays
        assert rays is not None
        assert self.fill is not None
        common = (self.D0, self.h0, self.problem.block_free, self.damping, F, g, d,
                  self.block_factor, self.block_y, self.determined)  # fmt: skip
        for p0, p1, v, A, B in linearised(self.problem, self.fill, k, node):
            self.cost[k] += excess(rays.records, v)
            base = int(rays.ray_start[p0])
            loc = rays.loc[base : int(rays.ray_start[p1])]
            if single_poses(rays.parts, A):
                self.cost[k] += eliminate_pose(p0, p1, base, rays.ray_start, v, A, B, loc, *common)
            else:
                parts = rays.parts
                self.cost[k] += eliminate(p0, p1, base, rays.ray_start, v, A, B, loc, parts.size, parts.start, *common)

    def result(self) -> Factored:
        """All that later steps need."""
        weak = [(k, row) for k, row in enumerate(self.weak) if row >= 0]
        return Factored(self.panels, self.y, self.block_factor, self.block_y, self.determined, self.diagonal, weak,
                        float(self.cost.sum()), self.damping)  # fmt: skip


Chunk = tuple[int, int, Float, Float, Float]


def single_poses(parts: Parts, A: Float) -> bool:
    """Whether rays are those of the faster kernels: two residuals, and one part of six unknowns."""
    return len(parts.size) == 1 and A.shape[1:] == (2, 6)


def linearised(problem: Problem, fill: Fill, k: int, node: Node) -> Iterator[Chunk]:
    """Linearised rays of the blocks of a node, in chunks: first and last block, v, A, B."""
    rays = problem.rays
    assert rays is not None
    records = rays.records
    widths = [next(u.size for u in problem.unknowns if u.name == g) for g, _ in records.touches]
    is_block = [g == problem.layout.eliminated for g, _ in records.touches]
    any_held = bool(problem.layout.held[node.columns].any())
    p0, end = int(rays.first[k]), int(rays.first[k + 1])
    while p0 < end:
        p1 = int(np.searchsorted(rays.ray_start, rays.ray_start[p0] + CHUNK, side="right")) - 1
        p1 = min(max(p1, p0 + 1), end)
        first, last = int(rays.ray_start[p0]), int(rays.ray_start[p1])
        v = np.empty((last - first, records.rows))
        J = tuple(np.empty((last - first, records.rows, w)) for w in widths)
        fill(first, last, v, J)
        kept = [j for j, block in zip(J, is_block) if not block]
        A = kept[0] if len(kept) == 1 else np.concatenate(kept, axis=2)
        if any_held:
            A = A * (part_columns(rays.parts, problem.layout, slice(first, last)) >= 0)[:, None, :]
        yield p0, p1, v, np.ascontiguousarray(A), next(j for j, block in zip(J, is_block) if block)
        p0 = p1


def side_by_side(kept: KeptRecords, layout: Layout, state: State) -> tuple[Float, Float]:
    """Whitened residuals and Jacobians of kept records, the Jacobians side by side and zero where held."""
    v, jacobians = whitened(kept.records, state, kept.rows)
    free = part_columns(kept.parts, layout) >= 0
    return np.ascontiguousarray(v), np.ascontiguousarray(np.concatenate(jacobians, axis=2) * free[:, None, :])


def share_out(problem: Problem) -> tuple[list[list[int]], list[list[int]]]:
    """Subtrees to run in parallel, the largest first, and the nodes above them, level by level from below."""
    nodes, rays = problem.tree.nodes, problem.rays
    count = np.zeros(len(nodes)) if rays is None else np.diff(rays.ray_start[rays.first])
    total = np.array([node.flops for node in nodes]) + RAY_FLOPS * count
    for k, node in enumerate(nodes):
        total[k] += sum(total[c] for c in node.children)
    roots = [k for k, node in enumerate(nodes) if node.parent < 0]
    whole = float(total[roots].sum())
    if problem.threads == 1 or whole < PARALLEL_FLOPS:
        return [], []
    heads: list[int] = []
    levels, level = [], roots
    while level:
        inner = [k for k in level if nodes[k].children and total[k] > whole / (4 * problem.threads)]
        heads += [k for k in level if k not in inner]
        levels.append(sorted(inner))
        level = [c for k in inner for c in nodes[k].children]
    heads.sort(key=lambda k: -total[k])
    return [_subtree(nodes, k) for k in heads], [found for found in reversed(levels) if found]


def _subtree(nodes: Sequence[Node], k: int) -> list[int]:
    found, queue = [], [k]
    while queue:
        j = queue.pop()
        found.append(j)
        queue += nodes[j].children
    return sorted(found)


def in_parallel(problem: Problem, work: Callable[[list[int]], None]) -> None:
    """Work on all nodes, in any order, shared out among the threads."""
    rays = problem.rays
    assert rays is not None
    count = np.diff(rays.ray_start[rays.first])
    share = (np.cumsum(count) - 1) * problem.threads // max(int(count.sum()), 1)
    parts = [np.flatnonzero((share == t) & (count > 0)).tolist() for t in range(problem.threads)]
    if problem.threads == 1 or RAY_FLOPS * count.sum() < PARALLEL_FLOPS:
        for nodes in parts:
            work(nodes)
    else:
        with ThreadPoolExecutor(problem.threads) as pool:
            list(pool.map(work, parts))
