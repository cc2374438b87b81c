"""Eliminated blocks moved to their own optimum, everything else held: after bold steps all, and open ones under a loss.

A long step of the kept unknowns (poses, a camera) may be right where the linear step of the points that goes with it is
not. Each point is therefore moved on by damped Newton steps,

    (D + lambda diag D) dy = -h,    D = sum B'B, h = sum B'v of its own records, weighted by the loss

each block with its own lambda; a step that raises the block's cost is refused. The cost of the whole only falls, and
is judged as a function of the kept unknowns alone (variable projection), whose valleys are less bent.

Beyond its bound a loss grows linearly and determines nothing along the residual. A point of two rays, one or both
beyond, slides along until a ray comes within the bound. Not to hold up all others it is moved after every step.

Source: Golub & Pereyra 1973, The differentiation of pseudo-inverses and nonlinear least squares problems whose
variables separate; Okatani & Deguchi 2007, On the Wiberg algorithm for matrix factorization.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from aatri.adjustment.elimination.chunks import over_rays
from aatri.adjustment.loss import NEWTON
from aatri.adjustment.records import CHUNK, Records, prepared_lane, whitened
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.threads import taken
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int, ranges

STEPS = 20
"""Most steps of a block."""

SETTLED = 1e-8
"""A block is left alone when its Newton decrement squared is below."""

FIRST, LESS, MORE, LEAST = 1e-3, 0.2, 8.0, 1e-9
"""Damping at first, its factors after a step that was taken or refused, and its lower bound."""

RAYS_AT_A_TIME = 100_000
"""Of the rays, to bound the memory."""

Veto = Callable[[State, State], str]
"""(old, new) -> why the new state is refused, or an empty text."""


def all_steadied(problem: IndexedProblem, state: dict[str, Any]) -> dict[str, Any]:
    """The state with every eliminated block at its own optimum, or on the way there: its cost only falls."""
    if problem.rays is None:
        return state
    blocks = np.flatnonzero((problem.hold[:, 0, 0] == 0.0) & (np.diff(problem.rays.ray_start) > 0))
    parts = np.searchsorted(problem.rays.ray_start[blocks], np.arange(0, len(problem.rays.rows), RAYS_AT_A_TIME))
    for part in np.split(blocks, parts[1:]):
        state = _moved(problem, state, part)
    return state


def steadied(problem: IndexedProblem, state: dict[str, Any], veto: Veto | None = None) -> dict[str, Any]:
    """The state with its open blocks moved to their own optimum, everything else held.

    Parameters
    ----------
    veto : callable, optional
        What it refuses is not done.
    """
    if problem.rays is None or problem.rays.records.loss is None:
        return state
    blocks = _open(problem, state)
    if not len(blocks):
        return state
    moved = _moved(problem, state, blocks)
    return state if veto and veto(state, moved) else moved


def rays_beyond(problem: IndexedProblem, state: State) -> Bool:
    """Which rays lie beyond the bound of their loss, in the order of the rays."""
    rays = problem.rays
    if rays is None or rays.records.loss is None:
        return np.zeros(0, dtype=bool)
    loss, fill = rays.records.loss, problem.ray_lane(state)
    beyond = np.zeros(len(rays.rows), dtype=bool)

    def one(_: int, p0: int, p1: int, v: Float, _A: Float, _B: Float) -> None:
        beyond[rays.ray_start[p0] : rays.ray_start[p1]] = loss.beyond(v)

    over_rays(problem, fill, one)
    return beyond


def _open(problem: IndexedProblem, state: State) -> Int:
    """Blocks that their records within the bound do not determine; others than these have their own observations."""
    rays = problem.rays
    assert rays is not None
    beyond, n = rays_beyond(problem, state), len(rays.block)
    block = np.repeat(np.arange(n), np.diff(rays.ray_start))
    active = taken(rays.records.active, rays.rows)
    within = rays.records.rows * np.bincount(block[active & ~beyond], minlength=n)
    is_open = (np.bincount(block[beyond], minlength=n) > 0) & (within < problem.block_free.sum(axis=1))
    is_open &= problem.hold[:, 0, 0] == 0.0
    for records, rows, observed in problem.direct:
        is_open[observed[records.active[rows]]] = False
    return np.flatnonzero(is_open)


def _moved(problem: IndexedProblem, state: dict[str, Any], blocks: Int) -> dict[str, Any]:
    """Damped Newton steps of all blocks at once, each accepted or refused by its own cost."""
    rays, group = problem.rays, problem.layout.eliminated
    assert rays is not None
    unknowns = next(u for u in problem.unknowns if u.name == group)
    loss = rays.records.loss
    records = rays.records if loss is None else replace(rays.records, loss=replace(loss, curvature=NEWTON))
    curved = replace(problem, rays=replace(rays, records=records))
    cost, D, h = _normal_equations(curved, state, blocks)
    damping = np.full(len(blocks), FIRST)
    for _ in range(STEPS):
        diagonal = np.einsum("nii->ni", D)
        added = np.where(diagonal > 0, damping[:, None] * diagonal, 1.0)  # held scalars have a unit row
        dy = np.asarray(-np.linalg.solve(D + added[:, :, None] * np.eye(3), h[:, :, None])[:, :, 0])
        go = -np.einsum("ni,ni->n", h, dy) > SETTLED
        blocks, cost, D, h, damping, dy = (a[go] for a in (blocks, cost, D, h, damping, dy))
        if not len(blocks):
            break
        step = np.zeros((len(unknowns.free), 3))
        step[rays.block[blocks]] = dy
        trial = {**state, group: unknowns.retract(state[group], step)}
        new_cost, new_D, new_h = _normal_equations(curved, trial, blocks)
        better = new_cost < cost
        step[rays.block[blocks[~better]]] = 0.0
        state = {**state, group: unknowns.retract(state[group], step)}
        cost, damping = np.where(better, new_cost, cost), np.maximum(damping * np.where(better, LESS, MORE), LEAST)
        D, h = np.where(better[:, None, None], new_D, D), np.where(better[:, None], new_h, h)
    return state


def _normal_equations(problem: IndexedProblem, state: State, blocks: Int) -> tuple[Float, Float, Float]:
    """Cost (n,), D (n, 3, 3) and h (n, 3) of some blocks by their own records."""
    rays = problem.rays
    assert rays is not None
    count = np.diff(rays.ray_start)[blocks]
    first = np.cumsum(count) - count
    ray = ranges(rays.ray_start[blocks], count)
    v, B = _of_rays(problem, rays.records, state, rays.rows[ray])
    B *= np.repeat(problem.block_free[blocks], count, axis=0)[:, None, :]
    costs = (v**2).sum(axis=1) if rays.records.loss is None else rays.records.loss.costs(v)
    cost = np.add.reduceat(costs, first)
    D = np.add.reduceat(np.einsum("nki,nkj->nij", B, B), first)
    h = np.add.reduceat(np.einsum("nki,nk->ni", B, v), first)
    for records, rows, observed in problem.direct:
        place = np.searchsorted(blocks, observed)
        own_rows = np.flatnonzero(np.isin(observed, blocks) & records.active[rows])
        v, (own,) = whitened(records, state, rows[own_rows])
        to, own = place[own_rows], own * problem.block_free[observed[own_rows]][:, None, :]
        np.add.at(cost, to, (v**2).sum(axis=1) if records.loss is None else records.loss.costs(v))
        np.add.at(D, to, np.einsum("nki,nkj->nij", own, own))
        np.add.at(h, to, np.einsum("nki,nk->ni", own, v))
    return cost, D, h


def _of_rays(problem: IndexedProblem, records: Records, state: State, rows: Int) -> tuple[Float, Float]:
    """Whitened residuals and Jacobians by the eliminated blocks, by the faster lane: `whitened`."""
    fill, (n, m) = prepared_lane(records, rows)(records.whitener[rows])(state), (len(rows), records.rows)
    v, B, sizes = np.empty((n, m)), np.empty((n, m, 3)), {u.name: u.size for u in problem.unknowns}
    is_block = [group == problem.layout.eliminated for group, _ in records.touches]
    for a in range(0, n, CHUNK):
        b = min(a + CHUNK, n)
        others = (np.empty((b - a, m, sizes[group])) for group, _ in records.touches)
        fill(a, b, v[a:b], tuple(B[a:b] if by_block else J for by_block, J in zip(is_block, others)))
    v[~records.active[rows]] = B[~records.active[rows]] = 0.0
    if records.loss is not None:
        records.loss.weigh(v, (B,))
    return v, B
