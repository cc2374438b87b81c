"""Step control under a robust loss: reweighted least squares, then Newton's method.

Far from the optimum each step is one of reweighted least squares, which lowers the cost surely but converges linearly.
Once the Newton decrement is below `NEAR` the curvature of the loss is taken into account, see `loss`: convergence is
then quadratic, and the decrement bounds the way that is left. Where that step is refused it came too soon.

What a loss leaves open is steadied block by block, see `open_blocks`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from aatri.adjustment.constraints import factorise_constrained
from aatri.adjustment.damping import Damping
from aatri.adjustment.fronts import Factored, Problem
from aatri.adjustment.loss import NEWTON, Huber
from aatri.adjustment.open_blocks import rays_beyond
from aatri.adjustment.records import Records, whitened
from aatri.adjustment.unknowns import State

NEAR = 0.3
"""Newton decrement from which on the curvature counts."""

LEAST = 1e-3
"""Newton decrement at which it counts in any case."""


def down_weighted(problem: Problem, state: State) -> int:
    """Number of records beyond the bound of their loss."""
    few = [(k.records, k.rows) for k in problem.kept] + [(r, rows) for r, rows, _ in problem.direct]
    count = sum(int(_beyond(records, state, rows).sum()) for records, rows in few)
    return count + int(rays_beyond(problem, state).sum())


def settled(problem: Problem, state: State) -> bool:
    """Whether the decrement is that of Newton's method, so that it may end the iteration."""
    losses = _losses(problem)
    return not losses or losses[0].curvature > 0 or down_weighted(problem, state) == 0


def turned(
    problem: Problem, state: State, factored: Factored, damping: Damping, decrement: float, near: float
) -> tuple[Problem, Factored, Damping, float]:
    """Turn to Newton's method near the optimum, and back where its step is refused.

    Parameters
    ----------
    problem, state, factored, damping
        As they are for the next step.
    decrement : float
        Of the last step.
    near : float
        Decrement below which to turn.
    """
    unchanged = problem, factored, damping, near
    losses = _losses(problem)
    if not losses:
        return unchanged
    refused = damping.value > 0.0
    if losses[0].curvature > 0:
        if not refused or near <= LEAST:
            return unchanged
        curvature, near = 0.0, max(0.1 * near, LEAST)
    elif refused or decrement > near or down_weighted(problem, state) == 0:
        return unchanged
    else:
        curvature = NEWTON
    problem = with_curvature(problem, curvature)
    return problem, factorise_constrained(problem, state), Damping(), near


def with_curvature(problem: Problem, curvature: float) -> Problem:
    """The problem with another curvature of its losses."""
    if not _losses(problem):
        return problem
    changed = {
        id(r): r if r.loss is None else replace(r, loss=replace(r.loss, curvature=curvature)) for r in problem.records
    }
    rays = problem.rays
    return replace(
        problem,
        records=tuple(changed.values()),
        rays=None if rays is None else replace(rays, records=changed[id(rays.records)]),
        kept=tuple(replace(k, records=changed[id(k.records)]) for k in problem.kept),
        direct=tuple((changed[id(r)], rows, blocks) for r, rows, blocks in problem.direct),
    )


def refuse_covariances(records_beyond: int) -> None:
    """Raise if a solution is not one of least squares: its weighted normal equations are not its covariance.

    Raises
    ------
    ValueError
    """
    if records_beyond:
        raise ValueError(f"no covariances: {records_beyond} records are down-weighted; adjust once more without loss")


def _losses(problem: Problem) -> list[Huber]:
    return [r.loss for r in problem.records if r.loss is not None]


def _beyond(records: Records, state: State, rows: npt.NDArray[np.integer]) -> npt.NDArray[np.bool_]:
    if records.loss is None:
        return np.zeros(0, dtype=bool)
    return records.loss.beyond(whitened(records, state, rows)[0])
