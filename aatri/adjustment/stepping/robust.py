"""Step control under a robust loss: from reweighted least squares to Newton's method.

Far from the optimum each step is one of reweighted least squares, which lowers the cost surely but converges linearly.
Once the Newton decrement is below `NEAR`, the curvature of the loss is taken into account (see `loss`), more after each
step that was taken, less after one that was refused or that gained little: on its way it has carried records across the
bound, where the cost bends again. Steps then grow to those of Newton's method, whose decrement bounds the way left.

Blocks that a loss leaves open are steadied one by one, see `open_blocks`.
"""

from dataclasses import replace

import numpy as np

from aatri.adjustment.loss import NEWTON, Huber
from aatri.adjustment.records import Records, whitened
from aatri.adjustment.stepping.runaways import rays_beyond
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.structure.weights import with_records
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Int

NEAR = 0.3
"""Newton decrement from which on the curvature counts."""

BOLDER, CAUTIOUS = 0.3, 10.0
"""Factors of 1 - curvature after a step that was taken or refused."""

POOR = 0.25
"""A step that lowers the cost by less than this share of what was predicted went too far."""

ENOUGH = 0.9
"""Curvature from which on the decrement is taken for that of Newton's method."""


def down_weighted(problem: IndexedProblem, state: State) -> int:
    """Number of records beyond the bound of their loss."""
    count = sum(int(_beyond(records, state, rows).sum()) for records, rows in problem.beside_rays)
    count += int(rays_beyond(problem, state).sum())
    others = problem.settings.others
    return count if others is None else int(others.total(count))


def settled(problem: IndexedProblem, state: State) -> bool:
    """Whether the decrement is nearly that of Newton's method, so that it may end the iteration."""
    return curvature_of(problem) >= ENOUGH or down_weighted(problem, state) == 0


def bolder(problem: IndexedProblem, decrement: float) -> IndexedProblem:
    """The problem for the step after one that was taken: near the optimum, closer to Newton's method."""
    if not _losses(problem) or decrement > NEAR:
        return problem
    return with_curvature(problem, min(1 - BOLDER * (1 - curvature_of(problem)), NEWTON))


def more_cautious(problem: IndexedProblem) -> IndexedProblem:
    """The problem for the step after one that was refused: closer to reweighted least squares."""
    return with_curvature(problem, max(1 - CAUTIOUS * (1 - curvature_of(problem)), 0.0))


def curvature_of(problem: IndexedProblem) -> float:
    """Curvature of the losses; 0 without a loss."""
    return max((loss.curvature for loss in _losses(problem)), default=0.0)


def with_curvature(problem: IndexedProblem, curvature: float) -> IndexedProblem:
    """The problem with another curvature of its losses."""
    if not _losses(problem) or curvature == curvature_of(problem):
        return problem
    changed = {
        id(r): r if r.loss is None else replace(r, loss=replace(r.loss, curvature=curvature)) for r in problem.records
    }
    return with_records(problem, changed)


def refuse_covariances(records_beyond: int) -> None:
    """Raise if a solution is not one of least squares: its weighted normal equations are not its covariance.

    Raises
    ------
    ValueError
    """
    if records_beyond:
        raise ValueError(f"no covariances: {records_beyond} records are down-weighted; adjust once more without loss")


def _losses(problem: IndexedProblem) -> list[Huber]:
    return [r.loss for r in problem.records if r.loss is not None]


def _beyond(records: Records, state: State, rows: Int) -> Bool:
    if records.loss is None:
        return np.zeros(0, dtype=bool)
    return records.loss.beyond(whitened(records, state, rows)[0])
