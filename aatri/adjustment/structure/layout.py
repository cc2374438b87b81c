"""Where every unknown stands: vertices of the kept unknowns, columns, and which blocks are eliminated.

A vertex is a kept block together with the blocks that join it; retained blocks of the eliminated group are vertices
too. A block whose scalars are all fixed has no vertex. Held scalars beside free ones keep their column, with a unit
diagonal. A vertex of one scalar has a second, fixed column, and where nothing is left to be kept one fixed block keeps
its columns: a front of the tree has two rows at least, for an array of one element is row-major to the compiler.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from aatri.adjustment.kernels.eliminate import MOST_RAYS
from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import Unknowns
from aatri.arrays import Bool, Float, Int


@dataclass(frozen=True)
class Layout:
    """Places of all unknowns."""

    vertex: dict[str, Int]
    """Dict of str to (n,) int32. Vertex of each block of a group; -1 where it has none (fixed, or eliminated)."""
    within: dict[str, int]
    """First scalar of a group's blocks within their vertex."""
    size: Int
    start: Int
    """(n_vertices,), (n_vertices + 1,) int64. Scalars of each vertex, and its first kept column."""
    fixed: Bool
    """(n_kept,). Columns of fixed scalars, those of blocks that take no part among them."""
    position: Float
    """(n_vertices, d)."""
    eliminated: str
    """Name of the eliminated group, or empty."""
    block: Int
    """(n,) int32. For each block of the eliminated group its number among the eliminated ones; -1 where retained."""
    shared: Bool
    """(n_vertices,). Vertices that other parts of the problem have, too."""

    @property
    def n_kept(self) -> int:
        """Kept columns."""
        return int(self.start[-1])

    def columns(self, group: str, k: int) -> Int:
        """Kept column of each scalar of a group's blocks, (n, k); -1 where it has none or is fixed."""
        vertex = self.vertex[group]
        first = np.where(vertex >= 0, self.start[np.maximum(vertex, 0)] + self.within[group], -1)
        columns = np.where(vertex[:, None] >= 0, first[:, None] + np.arange(k), -1)
        is_fixed = self.fixed[np.maximum(columns, 0)] if self.n_kept else np.ones_like(columns, dtype=bool)
        return np.where((columns >= 0) & ~is_fixed, columns, -1)


def layout_of(unknowns: Sequence[Unknowns], records: Sequence[Records]) -> Layout:
    """Place all unknowns.

    Raises
    ------
    ValueError
        If more than one group is eliminated, or a group joins one that does not stand before it.
    """
    eliminated = [u for u in unknowns if u.eliminated]
    if len(eliminated) > 1:
        raise ValueError("only one group may be eliminated")
    vertex: dict[str, Int] = {}
    within: dict[str, int] = {}
    sizes: list[Int] = []
    positions: list[Float] = []
    shared = [np.zeros(0, dtype=bool)]
    first_of: dict[str, int] = {}
    n = 0
    block = np.zeros(0, dtype=np.int32)
    filler = _filler(unknowns)
    for u in unknowns:
        if u.joins:
            continue
        mates = [w for w in unknowns if w.joins == u.name]
        is_kept = u.free.any(axis=1) | ((u.name == filler) & (np.arange(len(u.free)) == 0))
        for w in mates:
            is_kept = is_kept | w.free.any(axis=1)
        if u.eliminated:
            retained = _retained(u, records)
            block = np.where(retained, -1, np.cumsum(~retained) - 1).astype(np.int32)
            is_kept = is_kept & retained
        vertex[u.name] = np.where(is_kept, n + np.cumsum(is_kept) - 1, -1).astype(np.int32)
        within[u.name], first_of[u.name] = 0, n
        count, width = int(is_kept.sum()), u.size
        for w in mates:
            vertex[w.name], within[w.name] = vertex[u.name], width
            width += w.size
        sizes.append(np.full(count, max(width, 2)))
        place = np.full((len(u.free), 2), np.nan) if u.position is None else u.position[:, :2]
        positions.append(place[is_kept])
        shared.append(np.zeros(count, dtype=bool) if u.shared is None else u.shared[is_kept])
        n += count
    size = np.concatenate(sizes).astype(np.int64) if sizes else np.zeros(0, dtype=np.int64)
    start = np.concatenate([[0], np.cumsum(size)]).astype(np.int64)
    name = eliminated[0].name if eliminated else ""
    none_fixed = np.zeros(int(start[-1]), dtype=bool)
    joint, position = np.concatenate(shared), np.concatenate(positions)
    return with_fixed(Layout(vertex, within, size, start, none_fixed, position, name, block, joint), unknowns)


def _filler(unknowns: Sequence[Unknowns]) -> str:
    """The group whose first block keeps its columns though it is fixed, where none else is left; or empty."""
    kept = [u for u in unknowns if not u.eliminated]
    if any(u.free.any() for u in kept):
        return ""
    return next((u.name for u in kept if not u.joins and len(u.free)), "")


def with_fixed(layout: Layout, unknowns: Sequence[Unknowns]) -> Layout:
    """The layout with the scalars fixed that are not free."""
    is_fixed = np.ones(layout.n_kept, dtype=bool)
    for u in unknowns:
        chosen = layout.vertex[u.name] >= 0
        first = layout.start[layout.vertex[u.name][chosen]] + layout.within[u.name]
        is_fixed[(first[:, None] + np.arange(u.size)).ravel()] = ~u.free[chosen].ravel()
    return replace(layout, fixed=is_fixed)


def ray_records(records: Sequence[Records], eliminated: str) -> Records | None:
    """The one observation type whose records touch an eliminated block and kept ones: the largest such type."""
    candidates = [r for r in records if sum(g == eliminated for g, _ in r.touches) == 1 and len(r.touches) > 1]
    return max(candidates, key=lambda r: len(r.active)) if candidates else None


def _retained(group: Unknowns, records: Sequence[Records]) -> Bool:
    """Blocks that other observations join, or with too many rays, or that are to be kept."""
    retained = np.zeros(len(group.free), dtype=bool) if group.retained is None else group.retained.copy()
    rays = ray_records(records, group.name)
    if rays is None:
        return np.ones(len(group.free), dtype=bool)
    for r in records:
        touching = [blocks for name, blocks in r.touches if name == group.name]
        if r is rays:
            retained |= np.bincount(touching[0], minlength=len(retained)) > MOST_RAYS
        elif touching and len(r.touches) > 1:
            for blocks in touching:
                retained[blocks] = True
    return retained
