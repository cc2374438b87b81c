"""How the work on a tree is shared out among threads."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np

from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.structure.tree import FrontNode
from aatri.adjustment.threads import one_blas_thread, run_all, thread_control

Result = TypeVar("Result")

AtNode = Callable[[int, ThreadPoolExecutor | None], None]

THREADED_FLOPS = 5e8
"""Fronts with more work than this are factorised by several BLAS threads."""

RAY_FLOPS = 10000.0
"""Work of one ray against that of the factorisation, for sharing out the subtrees."""

STRETCH = 40_000
"""Rays that one thread works on at a time."""

SHARES = 8
"""Parts in which sums over all rays are made, whatever the number of threads, so that they have the same bits: most
threads that they use, each with a vector of all kept unknowns."""

PARALLEL_FLOPS = 1e9
"""Problems with less work than this run in one thread: others would mostly wait."""


@dataclass(frozen=True)
class Schedule:
    """Who works on which nodes of a tree, and in which order, on the way up and on the way down.

    Subtrees are independent: they run in parallel, one BLAS thread each. Above them the tree is worked on level by
    level; where a level has fewer nodes than there are threads, one node after the other with all BLAS threads. A small
    problem has no subtrees: its nodes come one after the other.
    """

    nodes: tuple[FrontNode, ...]
    subtrees: tuple[tuple[int, ...], ...]
    """The largest first; at least two, or none."""
    levels: tuple[tuple[int, ...], ...]
    """The nodes above them, from below."""
    threads: int
    reproducible: bool
    """One BLAS thread throughout."""

    @staticmethod
    def of(problem: IndexedProblem) -> Schedule:
        """The schedule of a problem."""
        subtrees, levels = _shared_out(problem)
        if len(subtrees) < 2:
            subtrees, levels = [], []
        return Schedule(
            problem.tree.nodes,
            tuple(map(tuple, subtrees)),
            tuple(map(tuple, levels)),
            problem.threads,
            problem.settings.reproducible,
        )

    @property
    def early(self) -> list[int]:
        """Nodes above, on levels where threads would be idle: their observations are taken with the subtrees."""
        return [k for level in self.levels if len(level) < self.threads for k in level]

    def up(self, assemble: AtNode, finish: Callable[[int], None]) -> None:
        """Children before their parents: assemble and finish every node; what is assembled early is asked for twice.

        Parameters
        ----------
        assemble : callable
            (node, pool or None): with a pool its threads may be used.
        finish : callable
            Once the children are finished.
        """

        def both(nodes: Sequence[int]) -> None:
            for k in nodes:
                assemble(k, None)
                finish(k)

        with ThreadPoolExecutor(self.threads) as pool, one_blas_thread():
            if not self.subtrees:
                for k in range(len(self.nodes)):
                    assemble(k, pool)
                    with self._blas([k]):
                        finish(k)
                return
            run_all(
                pool, [partial(both, tree) for tree in self.subtrees] + [partial(assemble, k, None) for k in self.early]
            )
            for level in self.levels:
                if len(level) >= self.threads:
                    run_all(pool, [partial(both, [k]) for k in level])
                    continue
                with self._blas(level):
                    both(level)

    def down(self, visit: AtNode) -> None:
        """Parents before their children, each subtree on its own, depth first, so that few fronts are in memory."""

        def several(nodes: Sequence[int]) -> None:
            for k in reversed(nodes):
                visit(k, None)

        with ThreadPoolExecutor(self.threads) as pool, one_blas_thread():
            for k in reversed(range(len(self.nodes) if not self.subtrees else 0)):
                visit(k, pool)
            for level in reversed(self.levels):
                with self._blas(level):
                    several(level)
            run_all(pool, [partial(several, tree) for tree in self.subtrees])

    def _blas(self, nodes: Sequence[int]) -> AbstractContextManager[Any]:
        """BLAS threads for some fronts: one unless a front is large enough to gain from more."""
        largest = max((self.nodes[k].flops for k in nodes), default=0.0)
        if self.threads == 1 or self.reproducible or largest <= THREADED_FLOPS:
            return nullcontext()
        limit: AbstractContextManager[Any] = thread_control().limit(limits=self.threads, user_api="blas")
        return limit


def _shared_out(problem: IndexedProblem) -> tuple[list[list[int]], list[list[int]]]:
    """Subtrees to run in parallel, the largest first, and the nodes above them, level by level from below."""
    nodes, rays = problem.tree.nodes, problem.rays
    count = np.zeros(len(nodes)) if rays is None else np.diff(rays.ray_start[rays.first])
    total = np.array([node.flops for node in nodes]) + RAY_FLOPS * count
    for k, node in enumerate(nodes):
        total[k] += sum(total[c] for c in node.children)
    roots = [k for k, node in enumerate(nodes) if node.parent < 0]
    flops_in_all = float(total[roots].sum())
    if problem.threads == 1 or flops_in_all < PARALLEL_FLOPS:
        return [], []
    heads: list[int] = []
    levels, level = [], roots
    while level:
        inner = [k for k in level if nodes[k].children and total[k] > flops_in_all / (4 * problem.threads)]
        heads += [k for k in level if k not in inner]
        levels.append(sorted(inner))
        level = [c for k in inner for c in nodes[k].children]
    heads.sort(key=lambda k: -total[k])
    return [_subtree(nodes, k) for k in heads], [
        nodes_of_level for nodes_of_level in reversed(levels) if nodes_of_level
    ]


def _subtree(nodes: Sequence[FrontNode], k: int) -> list[int]:
    members, queue = [], [k]
    while queue:
        j = queue.pop()
        members.append(j)
        queue += nodes[j].children
    return sorted(members)


@dataclass(frozen=True)
class Stretch:
    """Some blocks of one node, worked on by one thread at a time."""

    number: int
    """In the order of the nodes and their blocks."""
    node: int
    first: int
    last: int
    """The blocks first ... last - 1 of a node."""


def stretches(problem: IndexedProblem) -> list[Stretch]:
    """All blocks, in stretches of at most some `STRETCH` rays: the same for any number of threads."""
    all_stretches: list[Stretch] = []
    for k in range(len(problem.tree.nodes) if problem.rays is not None else 0):
        all_stretches += of_node(problem, k, len(all_stretches))
    return all_stretches


def of_node(problem: IndexedProblem, k: int, number: int = 0) -> list[Stretch]:
    """The stretches of one node, numbered from `number` on."""
    rays = problem.rays
    assert rays is not None
    p0, p1 = int(rays.first[k]), int(rays.first[k + 1])
    if p0 == p1:
        return []
    start = rays.ray_start[p0 : p1 + 1]
    count = int(start[-1] - start[0])
    parts = -(-count // STRETCH)
    if parts <= 1:  # none: points without any ray in use
        return [Stretch(number, k, p0, p1)]
    cuts = p0 + np.searchsorted(start, start[0] + count * np.arange(parts + 1) // parts)
    cuts = np.unique(np.clip(cuts, p0, p1)).tolist()
    return [Stretch(number + i, k, a, b) for i, (a, b) in enumerate(pairwise(cuts))]


def in_parallel(problem: IndexedProblem, work: Callable[[Sequence[Stretch]], None]) -> None:
    """Work on all blocks, in any order, shared out among the threads."""
    rays = problem.rays
    assert rays is not None
    all_stretches = stretches(problem)
    if problem.threads == 1 or RAY_FLOPS * len(rays.rows) < PARALLEL_FLOPS:
        work(all_stretches)
        return
    ends = rays.ray_start[[s.last for s in all_stretches]]
    share = (ends - 1) * problem.threads // max(int(ends[-1]), 1)
    parts = [[s for s, t in zip(all_stretches, share) if t == thread] for thread in range(problem.threads)]
    with ThreadPoolExecutor(problem.threads) as pool:
        list(pool.map(work, parts))


def in_shares(problem: IndexedProblem, work: Callable[[Sequence[Stretch]], Result]) -> list[Result]:
    """Work on all blocks in `SHARES` parts of about equally many rays, each by one thread; what each gives, in order.

    Sums that are added up in that order have the same bits for any number of threads.
    """
    rays, all_stretches = problem.rays, stretches(problem)
    assert rays is not None
    ends = rays.ray_start[[s.last for s in all_stretches]]
    share = (ends - 1) * SHARES // max(int(ends.max(initial=0)), 1)
    parts = [[s for s, t in zip(all_stretches, share) if t == part] for part in np.unique(share)]
    if problem.threads == 1 or RAY_FLOPS * len(rays.rows) < PARALLEL_FLOPS:
        return [work(part) for part in parts]
    with ThreadPoolExecutor(problem.threads) as pool:
        return list(pool.map(work, parts))
