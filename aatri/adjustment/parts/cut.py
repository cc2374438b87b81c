"""Which observations and unknowns make up the parts of a problem.

The elimination tree of the whole is cut: the heaviest subtree gives way to its children, until there are as many as
parts, and of a balanced weight. A part has the observations of its subtrees' nodes, with the blocks that are eliminated
there; what the nodes above eliminate is shared by all parts that observe it. The observations that belong to a node
above go to the part of its first child: each is in one part.

Unknowns keep the numbers that they have in the whole: those of other parts are held, and have no place in the index.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from aatri.adjustment.elimination.schedule import RAY_FLOPS
from aatri.adjustment.records import Records
from aatri.adjustment.stepping.runaways import Veto
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.structure.tree import Tree
from aatri.adjustment.unknowns import Unknowns
from aatri.arrays import Bool, Int

BALANCE = 1.2
"""Work of the heaviest part against the mean, up to which subtrees are not cut any further."""

VetoOf = Callable[[Int], Veto]
"""Rows of records -> why a step is refused on account of them."""


@dataclass(frozen=True)
class Part:
    """A part of a problem."""

    unknowns: tuple[Unknowns, ...]
    """All groups of the whole; what is not in the part is held."""
    rows: tuple[Int, ...]
    """Tuple of (n,). Its rows of all records."""
    own: dict[str, Bool]
    """Dict of str to (n,). Blocks whose values and covariances are taken from this part."""


def cut(problem: IndexedProblem, count: int) -> list[Part]:
    """The parts of a problem, at most so many.

    Parameters
    ----------
    problem : IndexedProblem
        Ordered by nested dissection.
    """
    rays = problem.rays
    n_rays = np.zeros(len(problem.tree.nodes), dtype=np.int64) if rays is None else np.diff(rays.ray_start[rays.first])
    part_of_node, above = nodes_of_parts(problem.tree, n_rays, count)
    n_parts = int(part_of_node.max()) + 1
    layout, rows = problem.layout, _rows(problem, part_of_node, n_parts)
    of_vertex = np.where(above[problem.tree.node_of], -1, part_of_node[problem.tree.node_of])
    of_block = _of_blocks(problem, part_of_node)
    met = np.zeros((n_parts, len(layout.size)), dtype=bool)
    for k in range(n_parts):
        met[k] = of_vertex == k
        for r, part_rows in zip(problem.records, rows[k]):
            for group, block in r.touches:
                vertex = layout.vertex[group][block[part_rows]]
                met[k, vertex[vertex >= 0]] = True
    met[0] |= ~met.any(axis=0)
    first = met.argmax(axis=0)
    return [_part(problem, rows[k], met[k], of_vertex == -1, first == k, of_block == k) for k in range(n_parts)]


def records_of(records: Sequence[Records], part: Part) -> tuple[Records, ...]:
    """The rows of a part of all records, copied."""
    return tuple(
        replace(r if len(rows) == len(r.active) else r.take(rows), label=None, similarity=None)
        for r, rows in zip(records, part.rows)
    )


def veto_of(vetoes: Sequence[VetoOf | None], records: Sequence[Records], part: Part) -> "Vetoes | None":
    """The vetoes of all records on account of the rows of a part, as one."""
    of_rows = [veto(rows[r.active[rows]]) for veto, r, rows in zip(vetoes, records, part.rows) if veto and len(rows)]
    return Vetoes(tuple(of_rows)) if of_rows else None


def _part(problem: IndexedProblem, rows: tuple[Int, ...], met: Bool, shared: Bool, first: Bool, blocks: Bool) -> Part:
    """One part: the vertices that it meets, those that are shared, those that it is the first to meet; its blocks."""
    unknowns, own = [], {}
    for u in problem.unknowns:
        vertex = problem.layout.vertex[u.name]
        kept = vertex >= 0
        inside = kept & met[vertex]
        own[u.name] = kept & first[vertex]
        retained = None
        if u.eliminated:
            retained = problem.layout.block < 0
            inside |= blocks
            own[u.name] |= blocks
        common = inside & kept & shared[vertex]
        unknowns.append(replace(u, free=u.free & inside[:, None], retained=retained, shared=common))
    return Part(tuple(unknowns), rows, own)


@dataclass(frozen=True)
class Vetoes:
    """Several vetoes as one."""

    of_rows: tuple[Veto, ...]

    def __call__(self, old: Any, new: Any) -> str:
        """Why the new state is refused, or an empty text."""
        return next((reason for veto in self.of_rows if (reason := veto(old, new))), "")


def nodes_of_parts(tree: Tree, n_rays: Int, count: int) -> tuple[Int, Bool]:
    """Part of each node, and which nodes are above the parts.

    Parameters
    ----------
    n_rays : (n_nodes,) int
    count : int
        Parts that are wanted.
    """
    nodes = tree.nodes
    work = np.array([node.flops for node in nodes]) + RAY_FLOPS * n_rays
    for k, node in enumerate(nodes):
        work[k] += sum(work[c] for c in node.children)
    heads = [k for k, node in enumerate(nodes) if node.parent < 0]
    while True:
        heads.sort(key=lambda k: -work[k])
        part, load = _shared_out([float(work[k]) for k in heads], count)
        largest = next((k for k in heads if nodes[k].children), None)
        balanced = len(heads) >= count and max(load) <= BALANCE * sum(load) / count
        if balanced or largest is None or len(heads) >= 4 * count:
            break
        heads.remove(largest)
        heads += nodes[largest].children
    of_node = np.full(len(nodes), -1, dtype=np.int64)
    of_node[heads] = part
    for k in reversed(range(len(nodes))):
        if of_node[k] < 0 and nodes[k].parent >= 0:
            of_node[k] = of_node[nodes[k].parent]
    above = of_node < 0
    for k in np.flatnonzero(above).tolist():  # children come first
        of_node[k] = of_node[nodes[k].children[0]]
    return of_node, above


def _shared_out(work: list[float], count: int) -> tuple[list[int], list[float]]:
    """Each piece to the part with the least work so far, the heaviest piece first."""
    load, part = [0.0] * count, []
    for piece in work:
        part.append(load.index(min(load)))
        load[part[-1]] += piece
    return part, load


def _rows(problem: IndexedProblem, part_of_node: Int, n_parts: int) -> list[tuple[Int, ...]]:
    """Rows of all records in each part."""
    part = {id(r): np.full(len(r.active), -1, dtype=np.int64) for r in problem.records}
    rays = problem.rays
    if rays is not None:
        of_block = np.repeat(part_of_node, np.diff(rays.first))
        part[id(rays.records)][rays.rows] = np.repeat(of_block, np.diff(rays.ray_start))
        for records, rows, block in problem.direct:
            part[id(records)][rows] = of_block[block]
    for kept in problem.kept:
        part[id(kept.records)][kept.rows] = np.repeat(part_of_node, np.diff(kept.first))
    return [tuple(np.flatnonzero(part[id(r)] == k) for r in problem.records) for k in range(n_parts)]


def _of_blocks(problem: IndexedProblem, part_of_node: Int) -> Int:
    """Part of each block of the eliminated group, -1 where it is kept."""
    owner = np.full(len(problem.layout.block), -1, dtype=np.int64)
    if problem.rays is not None:
        owner[problem.rays.block] = np.repeat(part_of_node, np.diff(problem.rays.first))
    return owner
