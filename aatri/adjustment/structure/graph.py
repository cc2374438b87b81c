"""Orders of elimination: nested dissection, and the textbook's chains.

Nested dissection cuts the vertices in two halves by position, takes the fewest vertices that touch all edges between
them as separator, and does the same to both halves; separators are eliminated after their halves, so that little fills
in.
Vertices of unknown position, and those with very many neighbours (shared cameras), go to the border, eliminated last.

A chain takes the vertices in a given order, some forty to a node, each node followed by the next: numbered across the
strips it is the band of the textbook, with a border the bordered band.

Source: George 1973; Koenig 1931; docs/formulas.md 4.4.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import maximum_bipartite_matching

from aatri.arrays import Bool, Float, Int

LEAF = 32
"""Vertices of a leaf, about."""


@dataclass(frozen=True)
class Graph:
    """Neighbours of each vertex, in compressed form."""

    start: Int
    """(n + 1,) int64."""
    neighbour: Int
    """(.,) int32."""

    @property
    def n(self) -> int:
        """Number of vertices."""
        return len(self.start) - 1

    def of(self, vertices: Int) -> tuple[Int, Int]:
        """Neighbours of some vertices, one list after the other, and how many each has."""
        counts = self.start[vertices + 1] - self.start[vertices]
        ends = np.cumsum(counts)
        index = np.arange(ends[-1] if len(ends) else 0) + np.repeat(self.start[vertices] - (ends - counts), counts)
        return self.neighbour[index], counts


@dataclass(frozen=True)
class OrderedNode:
    """A node of an order: its own vertices and the numbers of its children, which come before it."""

    own: Int
    children: tuple[int, ...]


def border_vertices(graph: Graph) -> Bool:
    """Vertices with more than 10 sqrt(n) neighbours: they would fill every separator."""
    return np.asarray(np.diff(graph.start) > 10 * np.sqrt(graph.n) + 40)


def nested_dissection(graph: Graph, position: Float, leaf: int = LEAF) -> list[OrderedNode]:
    """Order by nested dissection; children come before their parents.

    Parameters
    ----------
    position : (n, d) float64
        NaN where unknown: such vertices go to the border.
    """
    last = border_vertices(graph) | ~np.isfinite(position).all(axis=1)
    nodes: list[OrderedNode] = []
    side = np.full(graph.n, -1, dtype=np.int32)
    inner = np.flatnonzero(~last)
    children = (_cut(graph, position, inner, side, leaf, nodes),) if len(inner) else ()
    if last.any() or not nodes:
        nodes.append(OrderedNode(np.flatnonzero(last), children))
    return nodes


def _cut(graph: Graph, position: Float, vertices: Int, side: Int, leaf: int, nodes: list[OrderedNode]) -> int:
    """Add the nodes of some vertices; the number of the last, which separates the others."""
    if len(vertices) <= leaf:
        nodes.append(OrderedNode(vertices, ()))
        return len(nodes) - 1
    left, separator, right = _halves(graph, position, vertices, side)
    if not len(separator):  # nothing joins the halves; a node has a vertex all the same
        left, separator = left[1:], left[:1]
    children = tuple(_cut(graph, position, part, side, leaf, nodes) for part in (left, right) if len(part))
    nodes.append(OrderedNode(separator, children))
    return len(nodes) - 1


def _halves(graph: Graph, position: Float, vertices: Int, side: Int) -> tuple[Int, Int, Int]:
    """Left half, separator, right half; the better of the two directions."""
    best: tuple[Int, Int, Int] | None = None
    extent = np.ptp(position[vertices], axis=0)
    for axis in np.argsort(-extent)[:2]:
        if best is not None and extent[axis] < 0.5 * extent.max():
            continue
        order = vertices[np.argsort(position[vertices, axis], kind="stable")]
        half = len(order) // 2
        candidate = _separated(graph, order[:half], order[half:], side)
        if best is None or len(candidate[1]) < len(best[1]):
            best = candidate
    assert best is not None
    return best


def _separated(graph: Graph, left: Int, right: Int, side: Int) -> tuple[Int, Int, Int]:
    """Two halves and the fewest vertices that touch every edge between them.

    By Koenig's theorem they follow from a largest matching of the edges: with Z all that alternating paths reach from
    unmatched vertices of the left, they are the left ones outside Z and the right ones within.

    Parameters
    ----------
    side : (n,) int32
        Work space; -1, and left so.
    """
    neighbours, counts = graph.of(left)
    side[right] = np.arange(len(right))
    cut = np.flatnonzero(side[neighbours] >= 0)
    row, column = np.repeat(np.arange(len(left)), counts)[cut], side[neighbours[cut]]
    side[right] = -1
    degree = np.bincount(row, minlength=len(left))
    start = np.concatenate([[0], np.cumsum(degree)])
    edges = csr_array((np.ones(len(row), dtype=np.int8), column, start), shape=(len(left), len(right)))
    edges.sort_indices()
    column_of = maximum_bipartite_matching(edges, perm_type="column")
    row_of = np.full(len(right), -1)
    row_of[column_of[column_of >= 0]] = np.flatnonzero(column_of >= 0)
    touching = degree > 0
    in_left, in_right = np.zeros(len(left), dtype=bool), np.zeros(len(right), dtype=bool)
    new = touching & (column_of < 0)
    while new.any():
        in_left |= new
        reached = np.zeros(len(right), dtype=bool)
        reached[column[new[row]]] = True
        reached &= ~in_right
        in_right |= reached
        new = np.zeros(len(left), dtype=bool)
        new[row_of[reached]] = True  # each is matched: otherwise the matching could grow
        new &= ~in_left
    separator = touching & ~in_left
    return left[~separator], np.concatenate([left[separator], right[in_right]]), right[~in_right]


def chain(graph: Graph, order: Int) -> list[OrderedNode]:
    """The given order as a chain of nodes; border vertices last.

    Parameters
    ----------
    order : (n,) int
        All vertices in the order of their elimination.
    """
    last = border_vertices(graph)
    inner = order[~last[order]]
    nodes: list[OrderedNode] = []
    for k in range(0, len(inner), LEAF):
        nodes.append(OrderedNode(inner[k : k + LEAF], (len(nodes) - 1,) if nodes else ()))
    if last.any() or not nodes:
        nodes.append(OrderedNode(order[last[order]], (len(nodes) - 1,) if nodes else ()))
    return nodes
