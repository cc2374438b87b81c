"""Exact marginal covariances, by going back down the tree, a priori (sigma0 = 1).

The covariance of a front follows from that of its boundary, which is part of its parent's. While a front's covariance
is in memory the blocks of its own vertices, of its eliminated blocks, and of the adjusted values of their rays are read
off. Held scalars have zero covariance.

Redundancy numbers: with the covariance R of the whitened adjusted values of a record, I - R is that of its residuals,
and its diagonal are the redundancy numbers. Of an inactive record R is the covariance of its predicted value, and I + R
that of what the observation differs from it. Exact constraints reduce what was read off (`constrained_covariances`).
"""

from collections.abc import Collection
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np

from aatri.adjustment.covariance.constrained import covariance_reduction, reduce_covariances
from aatri.adjustment.covariance.gains import Gains, empty_gains, gains_of_rays
from aatri.adjustment.covariance.of_records import direct_covariances, kept_covariances, place_of
from aatri.adjustment.elimination import lapack
from aatri.adjustment.elimination.chunks import linearised, side_by_side
from aatri.adjustment.elimination.factor import Factored
from aatri.adjustment.elimination.joint import shared_front
from aatri.adjustment.elimination.schedule import Schedule, Stretch, of_node
from aatri.adjustment.kernels.covariance import block_covariances, part_of
from aatri.adjustment.records import predicted
from aatri.adjustment.stepping.adjusted import Adjusted, factor_of
from aatri.adjustment.stepping.robust import refuse_covariances
from aatri.adjustment.structure.index import part_columns
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.structure.tree import FrontNode
from aatri.adjustment.structure.weights import taking_no_part
from aatri.adjustment.threads import run_all, taken
from aatri.adjustment.unknowns import State
from aatri.arrays import Float, Int


@dataclass(frozen=True)
class Covariances:
    """Marginal covariances of an adjustment."""

    groups: dict[str, Float]
    """Dict of str to (n, k, k). Covariance of every block of every group; zero for held scalars, NaN for blocks that
    take no part."""
    rays: Float
    """(n, m, m). Covariance of the whitened adjusted values of the rays, by row of their records."""
    records: tuple[Float, ...]
    """Tuple of (n, m, m). The same of all records, in the order of the problem's; where not active, of the predicted
    values. NaN where a block that is touched takes no part."""
    gains: tuple[Gains, ...] = ()
    """How errors of each record move the blocks it touches; nothing where not asked for."""
    whitened: tuple[Float, ...] = ()
    """Tuple of (n, m). Whitened residuals of all records, active or not, where they were asked for."""


def marginal_covariances(adjusted: Adjusted, *, blocks: bool = True, gains_of: Collection[str] = ()) -> Covariances:
    """Covariances of all unknowns at the solution.

    Parameters
    ----------
    blocks : bool
        Also those of the eliminated blocks and of the rays.
    gains_of : collection of str
        Groups of unknowns of whose blocks the gains are wanted, see `gains`.
    """
    refuse_covariances(adjusted.down_weighted)
    factored = factor_of(adjusted)
    release = factored is not adjusted.factored
    return covariances_at(adjusted.problem, adjusted.state, factored, blocks=blocks, gains_of=gains_of, release=release)


def covariances_at(
    problem: IndexedProblem,
    state: State,
    factored: Factored,
    *,
    blocks: bool = True,
    gains_of: Collection[str] = (),
    residuals: bool = False,
    release: bool = False,
) -> Covariances:
    """Covariances of all unknowns at a state, from the factor of the linearisation there.

    `residuals` asks for those of the records too, which cost nothing on the way; it needs `blocks`. `release` gives
    back the memory of the factor on the way, which nothing can be asked of afterwards.
    """
    reduction = covariance_reduction(problem, factored, state)
    down = _Down(problem, state, factored, blocks, gains_of, residuals, release)
    down.run()
    covariances = down.result()
    reduce_covariances(problem, state, reduction, covariances.groups, covariances.records, covariances.gains)
    return covariances


_NOTHING: Float = np.zeros((0, 0), order="F")


class _Down:
    """The way down the tree; a front's covariance lives until its children have taken their parts."""

    def __init__(
        self,
        problem: IndexedProblem,
        state: State,
        factored: Factored,
        blocks: bool,
        gains_of: Collection[str],
        residuals: bool,
        release: bool,
    ) -> None:
        self.problem, self.state, self.factored = problem, state, factored
        self.blocks, self.residuals, self.release = blocks, residuals, release
        n_vertices = len(problem.layout.size)
        largest = int(problem.layout.size.max(initial=0))
        self.vertex_covariance = np.zeros((n_vertices, largest, largest))
        n_blocks = len(problem.block_free)
        self.block = np.full((n_blocks, 3, 3), np.nan)
        rays = problem.rays
        m = rays.records.rows if rays is not None else 0
        self.fill = problem.predicting_lane(state) if rays is not None and blocks else None
        self.active = taken(rays.records.active, rays.rows) if rays is not None else np.zeros(0, dtype=bool)
        self.ray_residual = np.empty((len(self.active) if residuals else 0, m))
        self.kept = [(k, *side_by_side(k, problem.layout, state, all_=True)) for k in problem.kept] if blocks else []
        self.of_records = tuple(np.full((len(r.active), r.rows, r.rows), np.nan) for r in problem.records)
        self.gains = tuple(empty_gains(r, problem, gains_of) for r in problem.records) if gains_of else ()
        self.boundary: dict[int, Float] = {}

    def run(self) -> None:
        """Go down the tree."""
        others = self.problem.settings.others
        if others is not None:
            front = shared_front(self.problem, others.shared_covariance())
            self.boundary[len(self.problem.tree.nodes) - 1] = front
        Schedule.of(self.problem).down(self._visit)

    def _visit(self, k: int, pool: ThreadPoolExecutor | None) -> None:
        """Covariances of a node, whose parent has been visited."""
        tree = self.problem.tree
        node, boundary = tree.nodes[k], self.boundary.pop(k, _NOTHING)
        S = lapack.panel_covariance(self.factored.factor.panel(k), boundary) if node.panel else boundary
        if self.release:
            self.factored.factor.release(k)
        self._take(k, node, S, pool)
        for child in node.children:
            self.boundary[child] = part_of(S, tree.maps[child])

    def _take(self, k: int, node: FrontNode, S: Float, pool: ThreadPoolExecutor | None) -> None:
        is_fixed = self.problem.layout.fixed[node.columns]
        if is_fixed.any():
            S[is_fixed, :] = 0.0
            S[:, is_fixed] = 0.0
        for i in range(node.own or len(node.vertices)):  # a root that eliminates nothing has what parts share
            a, b = int(node.offset[i]), int(node.offset[i + 1])
            self.vertex_covariance[node.vertices[i], : b - a, : b - a] = S[a:b, a:b]
        row_of = np.full(self.problem.layout.n_kept + 1, -1, dtype=np.int64)
        row_of[node.columns] = np.arange(node.size)
        for kept, _, jacobians in self.kept:
            place = place_of(self.problem, kept.records)
            gains = self.gains[place] if self.gains else None
            kept_covariances(self.problem, kept, jacobians, k, row_of, S, self.of_records[place], gains)
        if self.fill is None:
            return
        jobs = [partial(self._rays, stretch, S, row_of) for stretch in of_node(self.problem, k)]
        if pool is None or len(jobs) < 2:
            for job in jobs:
                job()
        else:
            run_all(pool, jobs)

    def _rays(self, stretch: Stretch, S: Float, row_of: Int) -> None:
        rays = self.problem.rays
        assert rays is not None
        assert self.fill is not None
        of_rays = self.of_records[place_of(self.problem, rays.records)]
        # S is zero where an unknown is held, so that A need not be; gains are of A itself.
        for p0, p1, v, A, B in linearised(self.problem, self.fill, stretch, masked=bool(self.gains)):
            base, last = int(rays.ray_start[p0]), int(rays.ray_start[p1])
            if self.residuals:
                self.ray_residual[base:last] = v
            active = self.active[base:last]
            X = np.empty((last - base if self.gains else 0, A.shape[2], 3))
            R = np.empty((last - base, A.shape[1], A.shape[1]))
            filled = (self.problem.block_free, self.factored.block_factor, self.block, R, X)
            loc, parts = rays.loc[base:last], rays.parts
            block_covariances(p0, p1, base, rays.ray_start, active, A, B, loc, parts.size, parts.start, S, *filled)
            of_rays[rays.rows[base:last]] = R
            if self.gains:
                row = row_of[part_columns(parts, self.problem.layout, slice(base, last))]
                block = np.repeat(np.arange(p0, p1), np.diff(rays.ray_start[p0 : p1 + 1]))
                gains = self.gains[place_of(self.problem, rays.records)]
                gains_of_rays(gains, rays.rows[base:last], A, B, row, S, X, block, self.block)

    def result(self) -> Covariances:
        """Covariances by group and block, and by row of the rays' records."""
        layout, groups = self.problem.layout, {}
        for u in self.problem.unknowns:
            vertex, first = layout.vertex[u.name], layout.within[u.name]
            blocks = np.zeros((len(u.free), u.size, u.size))
            is_kept = vertex >= 0
            if is_kept.any():
                part = slice(first, first + u.size)
                blocks[is_kept] = self.vertex_covariance[vertex[is_kept], part, part]
            if u.eliminated and self.problem.rays is not None:
                runaway = self.problem.hold[:, 0, 0] > 0
                blocks[self.problem.rays.block] = self.block
                blocks[self.problem.rays.block[runaway]] = np.nan
            groups[u.name] = blocks
        rays = self.problem.rays
        if self.blocks:
            direct_covariances(self.problem, self.state, self.block, self.of_records, self.gains)
        of_rays = np.zeros((0, 0, 0)) if rays is None else self.of_records[place_of(self.problem, rays.records)]
        for name, taking_none in taking_no_part(self.problem).items():
            groups[name][taking_none] = np.nan
            for r, of_record in zip(self.problem.records, self.of_records):
                for number in (b for group, b in r.touches if group == name and taking_none.any()):
                    of_record[taking_none[number]] = np.nan
        return Covariances(groups, of_rays, self.of_records, self.gains, self._whitened() if self.residuals else ())

    def _whitened(self) -> tuple[Float, ...]:
        """Whitened residuals of all records."""
        problem = self.problem
        residuals = tuple(np.full((len(r.active), r.rows), np.nan) for r in problem.records)
        if problem.rays is not None:
            residuals[place_of(problem, problem.rays.records)][problem.rays.rows] = self.ray_residual
        for kept, v, _ in self.kept:
            residuals[place_of(problem, kept.records)][kept.rows] = v
        for records, rows, _ in problem.direct:
            residuals[place_of(problem, records)][rows] = predicted(records, self.state, rows)[0]
        return residuals
