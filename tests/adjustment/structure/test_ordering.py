"""Nested dissection: orders and separators."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from aatri.adjustment.stepping.adjust import adjust_large
from aatri.adjustment.structure.graph import Graph, OrderedNode, nested_dissection
from aatri.adjustment.structure.index_problem import Ordering, prepare
from tests.adjustment.block_problem import posed_problem

ORDERS: tuple[Ordering, ...] = ("auto", "nested_dissection", "minimum_degree", "across_strips", "along_strips")


def _graph(n: int, edges: np.ndarray) -> Graph:
    both = np.unique(np.concatenate([edges, edges[:, ::-1]]), axis=0)
    start = np.searchsorted(both[:, 0], np.arange(n + 1))
    return Graph(start.astype(np.int64), both[:, 1].astype(np.int32))


def _below(nodes: list[OrderedNode], k: int) -> set[int]:
    return set(nodes[k].own.tolist()).union(*(_below(nodes, c) for c in nodes[k].children))


def _fewest_touching(edges: np.ndarray, n: int) -> int:
    """Fewest vertices that touch all edges, by trying all sets."""
    for size in range(n + 1):
        for some in combinations(range(n), size):
            if np.isin(edges, some).any(axis=1).all():
                return size
    raise AssertionError


@pytest.mark.parametrize("seed", range(8))
def test_a_separator_has_the_fewest_vertices_that_touch_all_edges_between_the_halves(seed: int) -> None:
    rng, half = np.random.default_rng(seed), 6
    position = np.column_stack([np.arange(2.0 * half), np.zeros(2 * half)])
    between = np.column_stack([rng.integers(0, half, 9), rng.integers(half, 2 * half, 9)])
    graph = _graph(2 * half, np.concatenate([between, [[0, 1], [half, half + 1]]]))
    nodes = nested_dissection(graph, position, leaf=half + 3)
    assert len(nodes[-1].own) == _fewest_touching(between, 2 * half)


@pytest.mark.parametrize("seed", range(4))
def test_every_vertex_is_eliminated_once_and_no_edge_joins_two_parts_that_a_separator_divides(seed: int) -> None:
    rng, n = np.random.default_rng(seed), 300
    position = rng.uniform(0, 1, (n, 2))
    distance = np.linalg.norm(position[:, None] - position[None], axis=2)
    edges = np.argwhere((distance < 0.12) & (distance > 0))
    nodes = nested_dissection(_graph(n, edges), position, leaf=16)
    assert sorted(np.concatenate([node.own for node in nodes]).tolist()) == list(range(n))
    for node in nodes:
        for a, b in combinations([_below(nodes, c) for c in node.children], 2):
            assert not any({int(i), int(j)} & a and {int(i), int(j)} & b for i, j in edges)


def test_an_order_that_is_asked_for_is_obeyed_in_a_small_problem_and_auto_takes_one_front() -> None:
    n = 70
    unknowns, records, start = posed_problem(1, n_kept=n, n_points=200)
    trees = {name: prepare(unknowns, records, ordering=name).tree for name in ORDERS}
    assert len(trees["auto"].nodes) == 1
    for name in ("nested_dissection", "across_strips", "along_strips"):
        assert len(trees[name].nodes) > 1
    assert trees["across_strips"].place.tolist() == list(range(n))  # positions ascend along the first coordinate
    expected = adjust_large(unknowns, records, start, ordering="auto").state["a"]
    for name in ORDERS:
        np.testing.assert_allclose(
            adjust_large(unknowns, records, start, ordering=name).state["a"], expected, atol=1e-9
        )


def test_vertices_that_nothing_joins_leave_no_node_empty() -> None:
    """As of points intersected from held images, each for itself."""
    n = 200
    graph = Graph(np.zeros(n + 1, dtype=np.int64), np.zeros(0, dtype=np.int32))
    nodes = nested_dissection(graph, np.random.default_rng(1).uniform(size=(n, 2)))
    assert all(len(node.own) for node in nodes)
    assert sorted(np.concatenate([node.own for node in nodes]).tolist()) == list(range(n))
