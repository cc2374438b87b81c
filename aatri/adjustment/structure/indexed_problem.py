"""An adjustment problem with its index."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from aatri.adjustment.problem import Problem, SolverSettings
from aatri.adjustment.records import Bind, Fill, Records, active_lane, prepared_lane
from aatri.adjustment.structure.index import EliminatedRecords, KeptRecords
from aatri.adjustment.structure.layout import Layout
from aatri.adjustment.structure.tree import Tree
from aatri.adjustment.threads import default_threads, taken
from aatri.adjustment.unknowns import State, Unknowns
from aatri.arrays import Bool, Float, Int


@dataclass(frozen=True)
class PartlyFactorised:
    """How much of a matrix is factorised where the whole factor has no room."""

    subtrees: tuple[tuple[int, ...], ...]
    """Nodes of subtrees that are factorised, children before parents."""
    piece: int
    """How many of the other unknowns are factorised together, at most."""


@dataclass(frozen=True)
class IndexedProblem:
    """An adjustment problem with its index: made once, used in every iteration."""

    stated: Problem
    """What was indexed, as it was stated."""
    unknowns: tuple[Unknowns, ...]
    """Its unknowns, with all scalars held of blocks that take no part; see `weights`."""
    records: tuple[Records, ...]
    """Its records, active or not: the index does not depend on it. The constraints follow them, as records of a weight.
    """
    layout: Layout
    tree: Tree
    rays: EliminatedRecords | None
    kept: tuple[KeptRecords, ...]
    direct: tuple[tuple[Records, Int, Int], ...]
    """Records that touch one eliminated block and nothing else."""
    block_free: Float
    """(n_blocks, 3). 1 where a scalar of an eliminated block is free, in the order of the rays' blocks."""
    settings: SolverSettings
    hold: Float
    """(n_blocks, 3, 3). Added to the normal matrix of an eliminated block without an observation: zero but for blocks
    that have no finite optimum, whose steps it shortens."""
    set_aside: dict[str, Bool] = field(default_factory=dict)
    """Dict of str to (n,). Blocks of any group that are held as weak, with all their records inactive."""
    spill: bool = False
    """The panels of the factor go to a file."""
    iterative: PartlyFactorised | None = None
    """Solve by conjugate gradients, with so much of the matrix factorised (`preconditioner`)."""

    @property
    def constraints(self) -> tuple[Records, ...]:
        """What must hold exactly; see `constraints`."""
        return self.stated.constraints

    def without_lanes(self) -> IndexedProblem:
        """The same without the copies of the rays in their order, which are made, and kept, once they are asked for."""
        if self.rays is None:
            return replace(self)
        records, rows = self.rays.records, self.rays.rows

        def weigh(whitener: Float) -> Bind:
            return prepared_lane(records, rows)(whitener)

        return replace(self, rays=replace(self.rays, lane=weigh))

    @property
    def threads(self) -> int:
        """Threads to use."""
        return self.settings.threads or default_threads()

    @property
    def observed(self) -> tuple[Records, ...]:
        """The records without the constraints."""
        return self.records[: len(self.records) - len(self.constraints)]

    @property
    def beside_rays(self) -> list[tuple[Records, Int]]:
        """Records that are no rays of eliminated blocks, and their rows."""
        return [(k.records, k.rows) for k in self.kept] + [(records, rows) for records, rows, _ in self.direct]

    @cached_property
    def ray_lane(self) -> Callable[[State], Fill]:
        """The rays' observation type in the order of the rays, zero where they are not active."""
        assert self.rays is not None
        records = self.rays.records
        return active_lane(self.predicting_lane, taken(records.active, self.rays.rows), records.loss)

    @cached_property
    def predicting_lane(self) -> Callable[[State], Fill]:
        """The rays' observation type in the order of the rays, active or not."""
        assert self.rays is not None
        return self.rays.lane(taken(self.rays.records.whitener, self.rays.rows))

    @cached_property
    def ray_columns(self) -> Int:
        """First kept column of each part of each ray, (n, parts); -1 where it is fixed."""
        assert self.rays is not None
        parts = self.rays.parts
        return np.append(self.layout.start[:-1], -1)[parts.vertex] + np.where(parts.vertex >= 0, parts.shift, 0)


def counts(problem: IndexedProblem) -> tuple[int, int, int]:
    """Observations, unknowns, and redundancy, which counts the constraints."""
    conditions = sum(r.observations for r in problem.constraints)
    observations = sum(r.observations for r in problem.records) - conditions
    n_unknowns = sum(int(u.free.sum()) for u in problem.unknowns)
    return observations, n_unknowns, observations + conditions - n_unknowns
