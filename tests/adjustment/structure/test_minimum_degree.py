"""Minimum degree: a valid order, close to the best on grids, good where no separators are known."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from aatri.adjustment.structure.graph import Graph, OrderedNode, chain, nested_dissection
from aatri.adjustment.structure.minimum_degree import minimum_degree
from aatri.adjustment.structure.tree import Tree, build_tree


def _graph(n: int, edges: np.ndarray) -> Graph:
    pairs = np.unique(np.concatenate([edges, edges[:, ::-1]]), axis=0)
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    start = np.concatenate([[0], np.cumsum(np.bincount(pairs[:, 0], minlength=n))])
    return Graph(start.astype(np.int64), pairs[:, 1].astype(np.int32))


def _grid(n: int) -> tuple[Graph, np.ndarray]:
    """n x n vertices, each with its eight neighbours."""
    row, column = np.divmod(np.arange(n * n), n)
    edges = []
    for i, j in ((0, 1), (1, 0), (1, 1), (1, -1)):
        inside = (row + i < n) & (column + j < n) & (column + j >= 0)
        here = np.flatnonzero(inside)
        edges.append(np.stack([here, here + i * n + j], axis=1))
    return _graph(n * n, np.concatenate(edges)), np.stack([row, column], axis=1).astype(float)


def _random(n: int, seed: int) -> Graph:
    return _graph(n, np.random.default_rng(seed).integers(0, n, (2 * n, 2)))


def _tree(graph: Graph, order: list[OrderedNode], size: np.ndarray) -> Tree:
    return build_tree(graph, order, size, np.cumsum(size) - size)


def _sizes(n: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).choice([3, 6, 12], n)


GRAPHS = {
    "grid": _grid(12)[0],
    "random": _random(300, 1),
    "in parts": _graph(90, np.array([(3 * k + i, 3 * k + j) for k in range(20) for i, j in ((0, 1), (1, 2))])),
    "with a border": _graph(300, np.array([(k, 299) for k in range(299)] + [(k, k + 1) for k in range(298)])),
    "without edges": _graph(5, np.zeros((0, 2), dtype=int)),
}


@pytest.mark.parametrize("leaf", [1, 3, 32])
@pytest.mark.parametrize("name", GRAPHS)
def test_every_vertex_is_in_one_node_and_every_boundary_in_the_parents_front(name: str, leaf: int) -> None:
    graph = GRAPHS[name]
    size = _sizes(graph.n, 0)
    order = minimum_degree(graph, size, leaf)
    assert sorted(np.concatenate([node.own for node in order])) == list(range(graph.n))
    assert all(child < k for k, node in enumerate(order) for child in node.children)
    children = [child for node in order for child in node.children]
    assert len(children) == len(set(children))
    tree = _tree(graph, order, size)
    for node in tree.nodes:
        parent = tree.nodes[node.parent].vertices if node.parent >= 0 else []
        assert set(node.vertices[node.own :]) <= set(parent)


@pytest.mark.parametrize("name", GRAPHS)
def test_fronts_are_those_of_an_elimination_vertex_by_vertex(name: str) -> None:
    """Without relaxation a tree's factor holds what eliminating the same vertices one by one on sets fills in."""
    graph = GRAPHS[name]
    size = _sizes(graph.n, 1)
    order = minimum_degree(graph, size, 1)
    adjacent = {v: set(graph.of(np.array([v]))[0].tolist()) for v in range(graph.n)}
    filled = 0
    for node in order:
        own = node.own.tolist()
        boundary = set().union(*(adjacent[v] for v in own)) - set(own)
        panel = int(size[own].sum())
        filled += panel * (panel + int(size[sorted(boundary)].sum()))
        for v in own:
            del adjacent[v]
        for v in boundary:
            adjacent[v] = (adjacent[v] | boundary) - {v} - set(own)
    assert 8 * filled == _tree(graph, order, size).factor_bytes


@pytest.mark.parametrize("name", ["minimum degree", "nested dissection"])
def test_work_on_a_grid_is_near_the_optimum(name: str) -> None:
    """829/84 n^3 multiplications by nested dissection of a nine-point grid (George & Liu 1981, theorem 8.1.2)."""
    n, size = 40, np.full(1600, 6)
    graph, position = _grid(n)
    order = minimum_degree(graph, size, 8) if name == "minimum degree" else nested_dissection(graph, position, 8)
    optimum = 2 * 829 / 84 * n**3 * 6**3
    assert 0.4 * optimum < _tree(graph, order, size).flops < 2 * optimum


def test_less_work_than_any_chain_where_there_is_no_shape() -> None:
    graph = _random(600, 2)
    size = _sizes(600, 2)
    found = _tree(graph, minimum_degree(graph, size), size).flops
    for shuffle in range(3):
        arrangement = np.random.default_rng(shuffle).permutation(600)
        assert found < 0.6 * _tree(graph, chain(graph, arrangement), size).flops


def test_a_star_is_eliminated_from_its_points_to_its_centre() -> None:
    graph = _graph(40, np.array([(0, k) for k in range(1, 40)]))
    order = minimum_degree(graph, np.full(40, 6), 1)
    assert 0 in order[-1].own
    assert _tree(graph, order, np.full(40, 6)).largest_front <= 12


def test_a_large_vertex_waits() -> None:
    """A path whose middle vertex has very many unknowns: it comes last, though others have as many neighbours."""
    graph = _graph(9, np.array([(k, k + 1) for k in range(8)]))
    size = np.full(9, 3)
    size[4] = 300
    assert 4 in minimum_degree(graph, size, 1)[-1].own


def test_the_same_order_every_time() -> None:
    graph, size = _random(500, 3), _sizes(500, 3)
    first, again = (minimum_degree(graph, size) for _ in range(2))
    for a, b in itertools.zip_longest(first, again):
        assert (a.own == b.own).all()
        assert a.children == b.children
