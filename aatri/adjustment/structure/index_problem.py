"""From unknowns and records to a problem with its index: graph, order, tree, places."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from aatri.adjustment.kernels.graph import counting_order, neighbours
from aatri.adjustment.problem import Ordering as Ordering
from aatri.adjustment.problem import Problem, SolverSettings
from aatri.adjustment.records import Records
from aatri.adjustment.structure.graph import Graph, OrderedNode, border_vertices, chain, nested_dissection
from aatri.adjustment.structure.index import Parts, group_sizes, index_kept, index_rays, parts_of
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.structure.layout import Layout, layout_of, ray_records
from aatri.adjustment.structure.tree import Tree, build_tree
from aatri.adjustment.structure.weights import with_parts_taken
from aatri.adjustment.unknowns import Unknowns
from aatri.arrays import Int

DENSE_VERTICES = 80
"""Up to this many vertices (some 500 unknowns) `auto` takes everything in one front."""

MOST_COMPARED = 3000
"""Beyond this many vertices with positions nested dissection has always been the better order."""

COMPARED_FLOPS = 5e5
"""Work per vertex above which a second order costs less than a better one is likely to save."""


def prepare(unknowns: Sequence[Unknowns], records: Sequence[Records], **settings: Any) -> IndexedProblem:
    """Index a problem without constraints, over all records, active or not.

    Parameters
    ----------
    **settings
        Of `SolverSettings`.
    """
    return indexed(Problem(tuple(unknowns), tuple(records)), SolverSettings(**settings))


def indexed(problem: Problem, settings: SolverSettings, support: Sequence[Records] = ()) -> IndexedProblem:
    """Index a problem.

    Parameters
    ----------
    support : sequence of Records
        Its constraints as records of a weight, see `constraints`.
    """
    unknowns, records = problem.unknowns, (*problem.records, *support)
    layout = layout_of(unknowns, records)
    sizes = group_sizes(unknowns)
    rays_of = ray_records(records, layout.eliminated) if layout.eliminated else None
    kept, direct = _sorted_out(records, rays_of, layout)
    ray_parts = _ray_parts(rays_of, layout, sizes) if rays_of is not None else None
    graph = _graph(layout, [parts_of(r, rows, layout, sizes) for r, rows in kept], ray_parts)
    tree = tree_of(graph, layout, settings.ordering)
    rays = index_rays(rays_of, *ray_parts, layout, tree) if rays_of is not None and ray_parts is not None else None
    free, position = _block_status(unknowns, layout, rays.block if rays is not None else None)
    index = IndexedProblem(
        problem,
        unknowns,
        records,
        layout,
        tree,
        rays,
        tuple(index_kept(r, rows, layout, tree, sizes) for r, rows in kept),
        tuple((r, rows, position[layout.block[blocks]]) for r, rows, blocks in direct),
        free,
        settings,
        np.zeros((len(free), 3, 3)),
    )
    return with_parts_taken(index)


def graph_of(unknowns: Sequence[Unknowns], records: Sequence[Records], layout: Layout) -> Graph:
    """Which vertices are observed together."""
    sizes = group_sizes(unknowns)
    rays_of = ray_records(records, layout.eliminated) if layout.eliminated else None
    kept, _ = _sorted_out(records, rays_of, layout)
    ray_parts = _ray_parts(rays_of, layout, sizes) if rays_of is not None else None
    return _graph(layout, [parts_of(r, rows, layout, sizes) for r, rows in kept], ray_parts)


def tree_of(graph: Graph, layout: Layout, ordering: Ordering) -> Tree:
    """The tree of an order of elimination, the root of which holds what is shared with other parts, if anything is."""
    if layout.shared.any():
        return _tree_below_shared(graph, layout)
    if ordering == "auto":
        return _better_tree(graph, layout)
    return _tree(graph, layout, _order(graph, layout, ordering))


def _sorted_out(
    records: Sequence[Records], rays: Records | None, layout: Layout
) -> tuple[list[tuple[Records, Int]], list[tuple[Records, Int, Int]]]:
    """Records of kept unknowns alone, and those of one eliminated block alone."""
    kept: list[tuple[Records, Int]] = []
    direct: list[tuple[Records, Int, Int]] = []
    for r in records:
        eliminated = np.zeros(len(r.active), dtype=bool)
        for group, blocks in r.touches:
            if group == layout.eliminated:
                eliminated |= layout.block[blocks] >= 0
        own = np.flatnonzero(~eliminated)
        if len(own):
            kept.append((r, own))
        if r is not rays and eliminated.any():
            rows = np.flatnonzero(eliminated)
            direct.append((r, rows, r.touches[0][1][rows]))
    return kept, direct


def _block_status(unknowns: Sequence[Unknowns], layout: Layout, block: Int | None) -> tuple[np.ndarray, Int]:
    """Free scalars of the eliminated blocks in the order of the rays' blocks, and the place of each block number."""
    if not layout.eliminated:
        return np.zeros((0, 3)), np.zeros(0, dtype=np.int64)
    group = next(u for u in unknowns if u.eliminated)
    original = np.flatnonzero(layout.block >= 0) if block is None else block
    position = np.empty(len(original), dtype=np.int64)
    position[layout.block[original]] = np.arange(len(original))
    return np.ascontiguousarray(group.free[original], dtype=np.float64), position


def _ray_parts(rays: Records, layout: Layout, sizes: dict[str, int]) -> tuple[Int, Int, Parts]:
    """Rows of the rays of eliminated blocks, the number of the block of each, and the parts they touch."""
    block = np.take(layout.block, next(b for g, b in rays.touches if g == layout.eliminated))
    rows = np.flatnonzero(block >= 0)
    return rows, np.take(block, rows), parts_of(rays, rows, layout, sizes)


def _graph(layout: Layout, kept: list[Parts], rays: tuple[Int, Int, Parts] | None) -> Graph:
    """Vertices that some record or eliminated block meets together."""
    n = len(layout.size)
    member, group, first = [], [], 0
    if rays is not None:
        _, block, parts = rays
        member.append(parts.vertex.ravel())
        group.append(np.repeat(block, parts.vertex.shape[1]))
        first = int(layout.block.max(initial=-1)) + 1
    for parts in kept:
        count, width = parts.vertex.shape
        if width < 2:
            continue
        member.append(parts.vertex.ravel())
        group.append(np.repeat(first + np.arange(count), width))
        first += count
    if not member:
        return Graph(np.zeros(n + 1, dtype=np.int64), np.zeros(0, dtype=np.int32))
    members, groups = np.concatenate(member).astype(np.int32), np.concatenate(group).astype(np.int32)
    is_kept = members >= 0
    if not is_kept.all():
        members, groups = members[is_kept], groups[is_kept]
    start, order = counting_order(first, groups)
    vertex_start, vertex_order = counting_order(n, members)
    adjacency = neighbours(n, start, np.take(members, order), vertex_start, np.take(groups, vertex_order))
    return Graph(*adjacency)


def _better_tree(graph: Graph, layout: Layout) -> Tree:
    """One front for few vertices; else nested dissection, or minimum degree where it is less work and worth trying."""
    if graph.n <= DENSE_VERTICES:
        return _tree(graph, layout, [OrderedNode(np.arange(graph.n), ())])
    tree = _tree(graph, layout, _order(graph, layout, "nested_dissection"))
    without_position = ~np.isfinite(layout.position).all(axis=1) & ~border_vertices(graph)
    worth = graph.n <= MOST_COMPARED and tree.flops > COMPARED_FLOPS * graph.n
    if not (worth or without_position.any()):
        return tree
    other = _tree(graph, layout, _order(graph, layout, "minimum_degree"))
    return other if other.flops < tree.flops else tree


def _tree(graph: Graph, layout: Layout, order: list[OrderedNode]) -> Tree:
    return build_tree(graph, order, layout.size, layout.start)


def _tree_below_shared(graph: Graph, layout: Layout) -> Tree:
    """By nested dissection, with a root that has the shared vertices as its boundary, and eliminates nothing."""
    place = np.where(layout.shared[:, None], np.nan, layout.position)  # that comes last
    *order, last = nested_dissection(graph, place)
    rest = last.own[~layout.shared[last.own]]
    children = last.children
    if len(rest):
        order.append(OrderedNode(rest, children))
        children = (len(order) - 1,)
    tree = _tree(graph, layout, [*order, OrderedNode(np.flatnonzero(layout.shared), children)])
    return replace(tree, nodes=(*tree.nodes[:-1], replace(tree.nodes[-1], own=0)))


def _order(graph: Graph, layout: Layout, ordering: Ordering) -> list[OrderedNode]:
    if ordering == "nested_dissection":
        return nested_dissection(graph, layout.position)
    if ordering == "minimum_degree":
        from aatri.adjustment.structure.minimum_degree import minimum_degree  # compiled, and small blocks need it not

        return minimum_degree(graph, layout.size)
    axis = 0 if ordering == "across_strips" else 1
    place = np.where(np.isfinite(layout.position), layout.position, np.inf)
    return chain(graph, np.lexsort((place[:, 1 - axis], place[:, axis])))
