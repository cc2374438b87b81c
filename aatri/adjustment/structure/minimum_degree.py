"""Order of elimination by approximate minimum degree: always the vertex whose front would be smallest.

It needs no positions, and beats nested dissection where the graph has no good separators. What it gives is one small
front per vertex; fronts are joined with their parents (relaxed amalgamation) where the zeros this fills in cost less
than a front of their own. A front of m own and b further unknowns costs, in flops,

    m^3/3 + m^2 b + m b^2  +  8 b^2 (its update is added to its parent)  +  a fixed share.

Children come before their parents, one subtree after the other; of several children the one that needs most room beside
what it leaves comes first, so that few fronts are in memory at a time (Liu 1986).

Source: Amestoy, Davis, Duff 1996; Ashcraft, Grimes 1989, The influence of relaxed supernode partitions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aatri.adjustment.kernels import minimum_degree as compiled
from aatri.adjustment.structure.graph import LEAF, Graph, OrderedNode, border_vertices
from aatri.arrays import Bool, Int

FRONT_FLOPS = 2e6
"""Work for which a front is not worth having: what its handling takes beside its arithmetic."""


def minimum_degree(graph: Graph, size: Int, leaf: int = LEAF) -> list[OrderedNode]:
    """Order by approximate minimum degree; children come before their parents.

    Parameters
    ----------
    size : (n,) int
        Unknowns of each vertex.
    leaf : int
        Fronts with fewer own vertices than this are joined with their parents if that costs little.
    """
    last = border_vertices(graph)
    inner = np.flatnonzero(~last)
    fronts = _joined(_fronts(*_without(graph, last), np.asarray(size, dtype=np.int64)[inner]), leaf)
    nodes = _one_subtree_after_the_other(fronts, inner)
    if last.any() or not nodes:
        inside = {c for node in nodes for c in node.children}
        nodes.append(OrderedNode(np.flatnonzero(last), tuple(k for k in range(len(nodes)) if k not in inside)))
    return nodes


@dataclass
class _Front:
    """A front while fronts are joined: own vertices, their unknowns, unknowns of the boundary."""

    own: list[int]
    panel: int
    boundary: int
    children: list[int]

    def with_child(self, child: _Front) -> _Front:
        """This front and one of its children as one."""
        own, children = child.own + self.own, self.children + child.children
        return _Front(own, child.panel + self.panel, self.boundary, children)

    @property
    def cost(self) -> float:
        """Work of the front and of handing on its update, in flops."""
        m, b = self.panel, self.boundary
        return m**3 / 3 + m * m * b + m * b * b + 8 * b * b + FRONT_FLOPS


def _fronts(start: Int, neighbour: Int, size: Int) -> list[_Front]:
    """One front for each pivot, children before parents."""
    pivots, parent, into, extent = compiled.minimum_degree(start, neighbour, size)
    number = np.full(len(size), -1)
    number[pivots] = np.arange(len(pivots))
    fronts = [_Front([], 0, int(extent[p]), []) for p in pivots]
    for v in range(len(size)):
        p = v
        while into[p] >= 0:
            p = into[p]
        front = fronts[number[p]]
        front.own.append(v)
        front.panel += int(size[v])
    for k, p in enumerate(pivots):
        if parent[p] >= 0:
            fronts[number[parent[p]]].children.append(k)
    return fronts


def _joined(fronts: list[_Front], leaf: int) -> dict[int, _Front]:
    """Fronts by number, joined with their children where that saves work."""
    by_number = dict(enumerate(fronts))
    for k in range(len(fronts)):
        for c in sorted(by_number[k].children, key=lambda c: -by_number[c].boundary):
            here, child = by_number[k], by_number[c]
            together = here.with_child(child)
            without_zeros = child.boundary == here.panel + here.boundary
            if without_zeros or (len(child.own) < leaf and together.cost <= child.cost + here.cost):
                together.children.remove(c)
                by_number[k] = together
                del by_number[c]
    return by_number


def _one_subtree_after_the_other(fronts: dict[int, _Front], vertices: Int) -> list[OrderedNode]:
    """Nodes of the order, depth first; of several children first the one whose need exceeds what it leaves the most."""
    need: dict[int, int] = {}
    for k in sorted(fronts):
        front, stacked, most = fronts[k], 0, 0
        front.children.sort(key=lambda c: fronts[c].boundary ** 2 - need[c])
        for c in front.children:
            most = max(most, stacked + need[c])
            stacked += fronts[c].boundary ** 2
        need[k] = max(most, stacked + (front.panel + front.boundary) ** 2)
    inside = {c for front in fronts.values() for c in front.children}
    waiting = [(k, False) for k in sorted(set(fronts) - inside, reverse=True)]
    nodes: list[OrderedNode] = []
    place: dict[int, int] = {}
    while waiting:
        k, ready = waiting.pop()
        if not ready:
            waiting += [(k, True), *((c, False) for c in reversed(fronts[k].children))]
            continue
        place[k] = len(nodes)
        nodes.append(OrderedNode(vertices[fronts[k].own], tuple(place[c] for c in fronts[k].children)))
    return nodes


def _without(graph: Graph, last: Bool) -> tuple[Int, Int]:
    """Start and neighbours of the graph of all but some vertices."""
    number = np.cumsum(~last) - 1
    owner = np.repeat(np.arange(graph.n), np.diff(graph.start))
    stays = ~last[owner] & ~last[graph.neighbour]
    count = np.bincount(number[owner[stays]], minlength=int((~last).sum()))
    start = np.concatenate([[0], np.cumsum(count)]).astype(np.int64)
    return start, number[graph.neighbour[stays]].astype(np.int32)
