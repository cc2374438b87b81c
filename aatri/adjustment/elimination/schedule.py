"""How the work on a tree is shared out among threads."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from aatri.adjustment.structure.indexed_problem import Problem
from aatri.adjustment.structure.tree import Node

THREADED_FLOPS = 5e8
"""Fronts with more work than this are factorised by several BLAS threads."""

RAY_FLOPS = 10000.0
"""Work of one ray against that of the factorisation, for sharing out the subtrees."""

PARALLEL_FLOPS = 1e9
"""Problems with less work than this run in one thread: others would mostly wait."""


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


def blas_threads(problem: Problem, nodes: Sequence[int]) -> int:
    """BLAS threads for some fronts: one unless a front is large enough to gain from more."""
    largest = max((problem.tree.nodes[k].flops for k in nodes), default=0.0)
    return problem.threads if largest > THREADED_FLOPS and not problem.reproducible else 1
