"""The elimination tree: dense fronts of kept unknowns, each with what it eliminates and what it passes on.

A node's front holds its own vertices, eliminated there, and its boundary: later vertices that its own or its
descendants' meet. The update of a node goes to its parent, whose front holds all of the node's boundary.
"""

from dataclasses import dataclass

import numpy as np

from aatri.adjustment.structure.graph import Graph, OrderedNode
from aatri.arrays import Int, ranges


@dataclass(frozen=True)
class FrontNode:
    """One front."""

    vertices: Int
    """(k,) int64. Own vertices, then the boundary, both in the order of elimination."""
    own: int
    """How many of them are its own."""
    offset: Int
    """(k + 1,) int64. Where each vertex starts in the front."""
    columns: Int
    """(n,) int64. Kept column of each row of the front."""
    parent: int
    """-1 for a root."""
    children: tuple[int, ...]

    @property
    def size(self) -> int:
        """Rows of the front."""
        return int(self.offset[-1])

    @property
    def panel(self) -> int:
        """Columns eliminated here."""
        return int(self.offset[self.own])

    @property
    def flops(self) -> float:
        """Multiplications and additions of the factorisation of the front."""
        m, b = self.panel, self.size - self.panel
        return m**3 / 3 + m * m * b + m * b * b


@dataclass(frozen=True)
class Tree:
    """All nodes, children before parents."""

    nodes: tuple[FrontNode, ...]
    node_of: Int
    """(n_vertices,) int32. Where each vertex is eliminated."""
    place: Int
    """(n_vertices,) int64. Place of each vertex in the order of elimination."""
    maps: tuple[Int, ...]
    """Tuple of (.,) int32. For each node: row of the parent's front for each row of its boundary."""

    @property
    def flops(self) -> float:
        """Predicted work of one factorisation."""
        return sum(node.flops for node in self.nodes)

    @property
    def factor_bytes(self) -> int:
        """Memory of the factor."""
        return 8 * sum(node.size * node.panel for node in self.nodes)

    @property
    def largest_front(self) -> int:
        """Rows of the largest front."""
        return max((node.size for node in self.nodes), default=0)


def build_tree(graph: Graph, order: list[OrderedNode], size: Int, start: Int) -> Tree:
    """Symbolic factorisation.

    Parameters
    ----------
    order : list of OrderedNode
        Every vertex in one node, children before parents.
    size : (n,) int
        Unknowns of each vertex.
    start : (n,) int
        First kept column of each vertex.
    """
    node_of, place = np.empty(graph.n, dtype=np.int32), np.empty(graph.n, dtype=np.int64)
    done = 0
    for k, ordered in enumerate(order):
        node_of[ordered.own] = k
        place[ordered.own] = done + np.arange(len(ordered.own))
        done += len(ordered.own)
    boundaries = _boundaries(graph, order, node_of, place)
    parent = np.full(len(order), -1)
    for k, ordered in enumerate(order):
        parent[list(ordered.children)] = k
    nodes = []
    for k, ordered in enumerate(order):
        vertices = np.concatenate([ordered.own, boundaries[k]]).astype(np.int64)
        offset = np.concatenate([[0], np.cumsum(size[vertices])]).astype(np.int64)
        columns = ranges(start[vertices], size[vertices])
        nodes.append(FrontNode(vertices, len(ordered.own), offset, columns, int(parent[k]), ordered.children))
    return Tree(tuple(nodes), node_of, place, tuple(_map(node, nodes, graph.n) for node in nodes))


def _boundaries(graph: Graph, order: list[OrderedNode], node_of: Int, place: Int) -> list[Int]:
    boundaries: list[Int] = []
    for k, ordered in enumerate(order):
        parts = [graph.of(ordered.own)[0], *(boundaries[c] for c in ordered.children)]
        later = np.unique(np.concatenate(parts)) if parts else np.zeros(0, dtype=np.int64)
        later = later[node_of[later] > k]
        boundaries.append(later[np.argsort(place[later])])
    return boundaries


def _map(node: FrontNode, nodes: list[FrontNode], n_vertices: int) -> Int:
    """Rows of the parent's front for the boundary of a node."""
    if node.parent < 0:
        return np.zeros(0, dtype=np.int32)
    parent = nodes[node.parent]
    row = np.empty(n_vertices, dtype=np.int64)
    row[parent.vertices] = parent.offset[:-1]
    boundary = node.vertices[node.own :]
    size = np.diff(node.offset)[node.own :]
    return ranges(row[boundary], size).astype(np.int32)
