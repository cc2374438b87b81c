"""Which records and eliminated blocks belong to which front, and where in it.

An eliminated block belongs to the node that eliminates the first of the kept vertices its rays meet: all of them lie in
that node's front. Its rays come in the order of elimination. A record of kept unknowns alone belongs to the node of the
first vertex it touches.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aatri.adjustment.kernels.graph import counting_order, lexical_order, sort_within
from aatri.adjustment.records import Records, Weigh, prepared_lane
from aatri.adjustment.structure.layout import Layout
from aatri.adjustment.structure.tree import Tree
from aatri.adjustment.threads import taken
from aatri.adjustment.unknowns import Unknowns
from aatri.arrays import Int, ranges

SORTED_IMAGES = 12
"""Images by which the blocks of a node are sorted: blocks of nearly the same images are eliminated at once."""


@dataclass(frozen=True)
class Parts:
    """The kept unknowns that records touch, joined groups taken together."""

    vertex: Int
    """(n, parts) int32. Vertex of each part; -1 where it is fixed."""
    shift: Int
    """(parts,) int64. First scalar of the part within its vertex."""
    size: Int
    start: Int
    """(parts,) int32. Scalars of a part, and its first column among the Jacobians laid side by side."""


@dataclass(frozen=True)
class KeptRecords:
    """Records of kept unknowns alone, sorted by node."""

    records: Records
    rows: Int
    """(n,) int64. Rows of the records, in order."""
    first: Int
    """(n_nodes + 1,) int64."""
    parts: Parts
    loc: Int
    """(n, parts) int32. Row of each part in the front of the record's node."""


@dataclass(frozen=True)
class EliminatedRecords:
    """Records of eliminated blocks (rays), sorted by node, block and order of elimination."""

    records: Records
    lane: Weigh
    """Their compiled lane, or the same by `evaluate`, in the order of the rays; see `records`."""
    rows: Int
    """(n,) int64. Rows of the records, in order."""
    ray_start: Int
    """(n_blocks + 1,) int64."""
    block: Int
    """(n_blocks,) int64. Block of the eliminated group, in order."""
    first: Int
    """(n_nodes + 1,) int64. First block of each node."""
    parts: Parts
    loc: Int
    """(n, parts) int32."""


def parts_of(records: Records, rows: Int, layout: Layout, size_of: dict[str, int]) -> Parts:
    """Parts of some rows of an observation type, in the order of its touches; blocks that are eliminated give none."""
    parts: list[tuple[Int, int, int, int]] = []
    column = 0
    for group, blocks in records.touches:
        vertex, shift, size = layout.vertex[group][blocks[rows]], layout.within[group], size_of[group]
        if group == layout.eliminated and not (layout.block[blocks[rows]] < 0).all():
            continue
        last = parts[-1] if parts else None
        if last and last[1] + last[2] == shift and shift > 0 and np.array_equal(last[0], vertex):
            parts[-1] = (last[0], last[1], last[2] + size, last[3])
        else:
            parts.append((vertex, shift, size, column))
        column += size
    return Parts(
        np.stack([f[0] for f in parts], axis=1).astype(np.int32) if parts else np.zeros((len(rows), 0), dtype=np.int32),
        np.array([f[1] for f in parts], dtype=np.int64),
        np.array([f[2] for f in parts], dtype=np.int32),
        np.array([f[3] for f in parts], dtype=np.int32),
    )


def part_columns(parts: Parts, layout: Layout, rows: slice | Int = slice(None)) -> Int:
    """Kept column of each column of the Jacobians, (n, columns) int64; -1 where the unknown is fixed."""
    vertex = parts.vertex[rows]
    first = np.where(vertex >= 0, layout.start[np.maximum(vertex, 0)] + parts.shift, -1)
    columns = [np.where(vertex[:, [i]] >= 0, first[:, [i]] + np.arange(s), -1) for i, s in enumerate(parts.size)]
    column = np.concatenate(columns, axis=1) if columns else np.zeros((len(vertex), 0), dtype=np.int64)
    if not layout.n_kept:
        return column.astype(np.int64)
    return np.where((column >= 0) & ~layout.fixed[np.maximum(column, 0)], column, -1).astype(np.int64)


def group_sizes(unknowns: Sequence[Unknowns]) -> dict[str, int]:
    """Scalars per block of each group."""
    return {u.name: u.size for u in unknowns}


def index_kept(records: Records, rows: Int, layout: Layout, tree: Tree, size_of: dict[str, int]) -> KeptRecords:
    """Sort records of kept unknowns by node."""
    parts = parts_of(records, rows, layout, size_of)
    node = _first_node(parts.vertex, tree)
    first, order = counting_order(len(tree.nodes), node)
    ordered = Parts(np.ascontiguousarray(parts.vertex[order]), parts.shift, parts.size, parts.start)
    return KeptRecords(records, rows[order], first, ordered, _places(ordered, node[order], tree))


def index_rays(
    records: Records, rows: Int, of_block: Int, parts: Parts, layout: Layout, tree: Tree
) -> EliminatedRecords:
    """Sort the rays of eliminated blocks by node, images of the block, block, and order of elimination.

    Parameters
    ----------
    rows, of_block : (n,) int
        Rows of the rays, and the number of the eliminated block of each.
    parts : Parts
        What they touch.
    """
    n_blocks = int(layout.block.max(initial=-1)) + 1
    lead = parts.vertex[:, 0] if parts.vertex.shape[1] else np.full(len(rows), -1)
    place = np.take(np.append(tree.place, len(tree.place)).astype(np.int32), lead)  # held, -1, comes last
    start, order = counting_order(n_blocks, of_block)
    sort_within(start, order, place)
    node_of_block = _block_nodes(parts.vertex, of_block, n_blocks, tree)
    count = np.diff(start)
    # within a node by their images, so that neighbouring blocks meet nearly the same places of the front
    by_images = lexical_order(len(tree.place) + 1, start, taken(place, order), SORTED_IMAGES)
    first, block = counting_order(len(tree.nodes), node_of_block[by_images])
    block = by_images[block]
    ray_start = np.concatenate([[0], np.cumsum(count[block])]).astype(np.int64)
    order = taken(order, ranges(start[block], count[block]))
    ordered = Parts(taken(parts.vertex, order), parts.shift, parts.size, parts.start)
    loc = _places(ordered, np.repeat(node_of_block[block], count[block]), tree)
    original = np.flatnonzero(layout.block >= 0)[block]
    rows = taken(rows, order)
    return EliminatedRecords(records, prepared_lane(records, rows), rows, ray_start, original, first, ordered, loc)


def _first_node(vertex: Int, tree: Tree) -> Int:
    """Node of the first vertex of each record; the last node where it has none."""
    last = len(tree.nodes) - 1
    node = np.where(vertex >= 0, tree.node_of[np.maximum(vertex, 0)], last) if vertex.size else vertex
    return np.asarray(node.min(axis=1, initial=last), dtype=np.int32)


def _block_nodes(vertex: Int, of_block: Int, n_blocks: int, tree: Tree) -> Int:
    node = np.full(n_blocks, len(tree.nodes) - 1, dtype=np.int32)
    np.minimum.at(node, of_block, _first_node(vertex, tree))
    return node


def _places(parts: Parts, node: Int, tree: Tree) -> Int:
    """Row of each part in the front of the given node of each record; records sorted by node."""
    loc = np.full(parts.vertex.shape, -1, dtype=np.int32)
    row = np.zeros(len(tree.place), dtype=np.int64)
    bounds = np.searchsorted(node, np.arange(len(tree.nodes) + 1))
    for k, front in enumerate(tree.nodes):
        of_node = slice(bounds[k], bounds[k + 1])
        if bounds[k] == bounds[k + 1]:
            continue
        row[front.vertices] = front.offset[:-1]
        vertex = parts.vertex[of_node]
        loc[of_node] = np.where(vertex >= 0, row[np.maximum(vertex, 0)] + parts.shift, -1)
    return loc
