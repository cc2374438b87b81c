"""Orders of elimination: nested dissection, and the textbook's chains.

Nested dissection cuts the vertices in two halves by position, takes those of the smaller side that touch the other half
as separator, and does the same to both halves; separators are eliminated after their halves, so that little fills in.
Vertices of unknown position, and those with very many neighbours (shared cameras), go to the border, eliminated last.

A chain takes the vertices in a given order, some forty to a node, each node followed by the next: numbered across the
strips it is the band of the textbook, with a border the bordered band.

Source: George 1973; photogrammetry.md A1002-A1006.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Float = npt.NDArray[np.float64]
Int = npt.NDArray[np.integer]

LEAF = 32
"""Vertices of a leaf, about."""


@dataclass(frozen=True)
class Graph:
    """Neighbours of each vertex, in compressed form.

    Attributes
    ----------
    start : (n + 1,) int64
    neighbour : (.,) int32
    """

    start: Int
    neighbour: Int

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


def border_vertices(graph: Graph) -> npt.NDArray[np.bool_]:
    """Vertices with more than 10 sqrt(n) neighbours: they would fill every separator."""
    return np.asarray(np.diff(graph.start) > 10 * np.sqrt(graph.n) + 40)


def nested_dissection(graph: Graph, position: Float, leaf: int = LEAF) -> list[OrderedNode]:
    """Order by nested dissection; children come before their parents.

    Parameters
    ----------
    graph : Graph
    position : (n, d) float64
        NaN where unknown: such vertices go to the border.
    leaf : int
    """
    last = border_vertices(graph) | ~np.isfinite(position).all(axis=1)
    nodes: list[OrderedNode] = []
    side = np.zeros(graph.n, dtype=np.int8)

    def cut(vertices: Int) -> int:
        if len(vertices) <= leaf:
            nodes.append(OrderedNode(vertices, ()))
            return len(nodes) - 1
        left, separator, right = _halves(graph, position, vertices, side)
        children = tuple(cut(part) for part in (left, right) if len(part))
        nodes.append(OrderedNode(separator, children))
        return len(nodes) - 1

    inner = np.flatnonzero(~last)
    children = (cut(inner),) if len(inner) else ()
    if last.any() or not nodes:
        nodes.append(OrderedNode(np.flatnonzero(last), children))
    return nodes


def _halves(graph: Graph, position: Float, vertices: Int, side: npt.NDArray[np.int8]) -> tuple[Int, Int, Int]:
    """Left half, separator, right half; the better of the two directions and sides."""
    best: tuple[Int, Int, Int] | None = None
    extent = np.ptp(position[vertices], axis=0)
    for axis in np.argsort(-extent)[:2]:
        if best is not None and extent[axis] < 0.5 * extent.max():
            continue
        order = vertices[np.argsort(position[vertices, axis], kind="stable")]
        half = len(order) // 2
        left, right = order[:half], order[half:]
        side[left], side[right] = 1, 2
        for first, second, other in ((left, right, 2), (right, left, 1)):
            touching = _touching(graph, first, side, other)
            candidate = (first[~touching], first[touching], second)
            if best is None or len(candidate[1]) < len(best[1]):
                best = candidate
        side[vertices] = 0
    assert best is not None
    return best


def _touching(graph: Graph, vertices: Int, side: npt.NDArray[np.int8], other: int) -> npt.NDArray[np.bool_]:
    neighbours, counts = graph.of(vertices)
    owner = np.repeat(np.arange(len(vertices)), counts)
    return np.asarray(np.bincount(owner, side[neighbours] == other, minlength=len(vertices)) > 0)


def chain(graph: Graph, order: Int, width: int = LEAF) -> list[OrderedNode]:
    """The given order as a chain of nodes; border vertices last.

    Parameters
    ----------
    graph : Graph
    order : (n,) int
        All vertices in the order of their elimination.
    width : int
        Vertices of a node.
    """
    last = border_vertices(graph)
    inner = order[~last[order]]
    nodes: list[OrderedNode] = []
    for k in range(0, len(inner), width):
        nodes.append(OrderedNode(inner[k : k + width], (len(nodes) - 1,) if nodes else ()))
    if last.any() or not nodes:
        nodes.append(OrderedNode(order[last[order]], (len(nodes) - 1,) if nodes else ()))
    return nodes


def bandwidth(graph: Graph, order: Int) -> int:
    """Half bandwidth, in vertices and with the diagonal, of the matrix whose rows come in this order."""
    place = np.empty(graph.n, dtype=np.int64)
    place[order] = np.arange(graph.n)
    owner = np.repeat(np.arange(graph.n), np.diff(graph.start))
    return int(np.abs(place[owner] - place[graph.neighbour]).max(initial=0)) + 1
