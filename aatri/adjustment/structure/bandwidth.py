"""What an order of elimination costs: half bandwidth, border, stored elements, work.

The half bandwidth counts from the diagonal to the last element of a row that is not zero, with the diagonal, in
vertices (images) and in unknowns. The border is left out: vertices that very many others meet, and those without a
place (cameras, strips); in a bordered band they stand beside the band. Stored elements and work are those of the
fronts, in which bands are some forty vertices wide.

Source: docs/formulas.md 4.4.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from aatri.adjustment.structure.graph import Graph, border_vertices
from aatri.adjustment.structure.index_problem import Ordering, graph_of, tree_of
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.structure.tree import Tree
from aatri.arrays import Bool, Float, Int


@dataclass(frozen=True)
class OrderingFigures:
    """Figures of one order of elimination."""

    ordering: str
    half_bandwidth: int
    """Vertices, with the diagonal, without the border."""
    half_bandwidth_unknowns: int
    border_unknowns: int
    stored: int
    """Elements of the factor."""
    flops: float
    """Multiplications and additions of a factorisation."""


def ordering_figures(
    problem: IndexedProblem, used: Ordering, others: Sequence[Ordering], position: Float
) -> tuple[OrderingFigures, ...]:
    """Figures of the order in use, and of others.

    Parameters
    ----------
    used : str
        Name of the problem's own order.
    others : sequence of str
        Chains or other orders to compare with.
    position : (n_vertices, 2) float64
        Places of the vertices for the others: along, across.
    """
    graph = graph_of(problem.unknowns, problem.records, problem.layout)
    layout = replace(problem.layout, position=position)
    border = border_vertices(graph) | ~np.isfinite(position).all(axis=1)
    trees = [(used, problem.tree), *((name, tree_of(graph, layout, name)) for name in others)]
    return tuple(_figures(name, graph, tree, layout.size, border) for name, tree in trees)


def half_bandwidth(graph: Graph, place: Int, size: Int, border: Bool) -> tuple[int, int]:
    """Half bandwidth in vertices and in unknowns, with the diagonal, the border left out.

    Parameters
    ----------
    place : (n,) int
        Place of each vertex in the order of elimination.
    size : (n,) int
        Unknowns of each vertex.
    border : (n,) bool
        Vertices beside the band.
    """
    inner = ~border
    order = np.argsort(place, kind="stable")
    order = order[inner[order]]
    rank, first = np.zeros(graph.n, dtype=np.int64), np.zeros(graph.n, dtype=np.int64)
    rank[order] = np.arange(len(order))
    first[order] = np.cumsum(size[order]) - size[order]
    owner = np.repeat(np.arange(graph.n), np.diff(graph.start))
    later = inner[owner] & inner[graph.neighbour] & (rank[graph.neighbour] > rank[owner])
    a, b = owner[later], graph.neighbour[later]
    vertices = int((rank[b] - rank[a]).max(initial=0)) + 1
    unknowns = int((first[b] + size[b] - first[a]).max(initial=int(size[inner].max(initial=0))))
    return vertices, unknowns


def _figures(name: str, graph: Graph, tree: Tree, size: Int, border: Bool) -> OrderingFigures:
    band = half_bandwidth(graph, tree.place, size, border)
    return OrderingFigures(name, *band, int(size[border].sum()), tree.factor_bytes // 8, tree.flops)
