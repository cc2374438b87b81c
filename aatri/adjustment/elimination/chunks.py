"""Linearised observations as the kernels take them: rays in chunks, other records side by side."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from aatri.adjustment.elimination.schedule import Stretch, in_parallel
from aatri.adjustment.records import CHUNK, Fill, predicted, whitened
from aatri.adjustment.structure.index import KeptRecords, part_columns
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.structure.layout import Layout
from aatri.adjustment.unknowns import State
from aatri.arrays import Float

Chunk = tuple[int, int, Float, Float, Float]


def over_rays(problem: IndexedProblem, fill: Fill, work: Callable[[int, int, int, Float, Float, Float], None]) -> None:
    """Linearise all rays, shared out among the threads: `work` gets the stretch, first and last block, v, A, B.

    A is as it is where an unknown is held.
    """

    def one(share: Sequence[Stretch]) -> None:
        for stretch in share:
            for chunk in linearised(problem, fill, stretch, masked=False):
                work(stretch.number, *chunk)

    in_parallel(problem, one)


def linearised(problem: IndexedProblem, fill: Fill, stretch: Stretch, *, masked: bool = True) -> Iterator[Chunk]:
    """Linearised rays of a stretch of blocks, in chunks: first and last block, v, A, B.

    A is zero where an unknown is held, unless it is asked for as it is (not `masked`): fronts are cleared there as a
    whole, which costs less.
    """
    rays = problem.rays
    assert rays is not None
    records = rays.records
    widths = [next(u.size for u in problem.unknowns if u.name == g) for g, _ in records.touches]
    is_block = [g == problem.layout.eliminated for g, _ in records.touches]
    any_held = masked and bool(problem.layout.fixed[problem.tree.nodes[stretch.node].columns].any())
    p0, end = stretch.first, stretch.last
    while p0 < end:
        p1 = int(np.searchsorted(rays.ray_start, rays.ray_start[p0] + CHUNK, side="right")) - 1
        p1 = min(max(p1, p0 + 1), end)
        first, last = int(rays.ray_start[p0]), int(rays.ray_start[p1])
        v = np.empty((last - first, records.rows))
        J = tuple(np.empty((last - first, records.rows, w)) for w in widths)
        fill(first, last, v, J)
        kept = [j for j, block in zip(J, is_block) if not block]
        A = kept[0] if len(kept) == 1 else np.concatenate(kept, axis=2)
        if any_held and last > first:
            A = A * (part_columns(rays.parts, problem.layout, slice(first, last)) >= 0)[:, None, :]
        yield p0, p1, v, np.ascontiguousarray(A), next(j for j, block in zip(J, is_block) if block)
        p0 = p1


def side_by_side(kept: KeptRecords, layout: Layout, state: State, *, all_: bool = False) -> tuple[Float, Float]:
    """Whitened residuals and Jacobians of kept records, the Jacobians side by side and zero where held.

    `all_`: also of records that are not active, and without their loss.
    """
    v, jacobians = (predicted if all_ else whitened)(kept.records, state, kept.rows)
    free = part_columns(kept.parts, layout) >= 0
    return np.ascontiguousarray(v), np.ascontiguousarray(np.concatenate(jacobians, axis=2) * free[:, None, :])
