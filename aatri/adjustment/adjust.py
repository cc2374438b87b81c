"""Non-linear least squares of any size: Gauss-Newton with Levenberg-Marquardt fall-back, front by front.

Converged when the Newton decrement of an undamped step is at most `tolerance`, which bounds the step of every unknown
by `tolerance` times its own standard deviation, and the step keeps to the linear model (`linearity`); it is applied. A
step that raises the cost, or that a veto refuses (a point changes its side of the camera), is repeated with damping.
What does not converge is a failure.

An eliminated block that is determined at the start but no longer at a later step has no finite optimum (a point that
runs away along nearly parallel rays): its steps are shortened from then on, it is reported, and it has no covariance.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from aatri.adjustment.adjusted import Adjusted as Adjusted
from aatri.adjustment.adjusted import Step
from aatri.adjustment.constraints import factorise_constrained, penalty, predicted_by_constraints, support
from aatri.adjustment.diagnosis import refuse_undetermined
from aatri.adjustment.elimination.backsolve import cost_of, predicted_decrease, steps
from aatri.adjustment.forecast import Solver, within_limit
from aatri.adjustment.records import Records, whitened
from aatri.adjustment.stepping.damping import Damping, gain
from aatri.adjustment.stepping.linearity import LINEAR, after_step
from aatri.adjustment.stepping.robust import (
    POOR,
    bolder,
    curvature_of,
    down_weighted,
    more_cautious,
    settled,
    with_curvature,
)
from aatri.adjustment.stepping.runaways import steadied
from aatri.adjustment.weakness import refuse_nearly_singular, weak_blocks_of, without_weak_blocks
from aatri.adjustment.structure.index_problem import Ordering, prepare
from aatri.adjustment.structure.indexed_problem import Factored, Problem, counts
from aatri.adjustment.structure.weights import taking_no_part
from aatri.adjustment.unknowns import State, Unknowns, retract_state
from aatri.arrays import Float, Int
from aatri.errors import ConvergenceError
from aatri.notes import Note
from aatri.progress import SILENT, Reporter, tell_iteration


HOLD = 1e-9
"""Share of its own normal matrix by which the steps of a block without finite optimum are shortened."""

Veto = Callable[[State, State], str]
"""(old, new) -> why the new state is refused, or an empty text."""


def adjust_large(
    unknowns: Sequence[Unknowns],
    records: Sequence[Records],
    start: State,
    *,
    constraints: Sequence[Records] = (),
    max_iterations: int = 30,
    tolerance: float = 1e-3,
    veto: Veto | None = None,
    ordering: Ordering = "auto",
    threads: int | None = None,
    reproducible: bool = False,
    memory_gb: float | None = None,
    solver: Solver = "auto",
    reporter: Reporter = SILENT,
) -> Adjusted:
    """Adjust a problem.

    Parameters
    ----------
    unknowns, records
        The problem.
    start : mapping
        Values of all groups.
    constraints : sequence of Records
        What must hold exactly, given like observations; see `constraints`.
    max_iterations : int
    tolerance : float
        Bound of the Newton decrement.
    veto : callable, optional
    ordering, threads, reproducible
        See `prepare`.
    memory_gb, solver
        See `forecast`: limit of the memory, and what to do beyond it.
    reporter : Reporter

    Raises
    ------
    GeometryError
        If unknowns are not determined; the message names them.
    ConvergenceError
        If the iteration does not converge; the message names the worst records.
    """
    all_records = [*records, *support(unknowns, records, constraints, start)]
    problem = prepare(unknowns, all_records, ordering=ordering, threads=threads, reproducible=reproducible)
    problem = within_limit(replace(problem, constraints=tuple(constraints)), memory_gb, solver, reporter)
    notes = _without_observations(problem)
    state: dict[str, Any] = dict(start)
    factored = factorise_constrained(problem, state)
    _check(problem, state, factored)
    if problem.subtrees is not None:
        from aatri.adjustment.iterative.conjugate_gradients import refuse_singular  # compiled only where it is needed

        refuse_singular(problem, state)
    linear = problem.subtrees is None and all(r.linear and r.loss is None for r in problem.records)
    damping, history = Damping(), []
    for iteration in range(1, max_iterations + 1):
        found = steps(problem, factored, state)
        decrement = _decrement(problem, factored)
        history.append(Step(factored.cost, decrement, factored.damping))
        tell_iteration(reporter, iteration, factored.cost, counts(problem)[2], decrement, damping.value)
        trial = steadied(problem, retract_state(problem.unknowns, state, found), veto)
        if factored.damping == 0.0 and (linear or decrement <= tolerance) and settled(problem, state):
            weak, hardly = weak_blocks_of(problem, factored)
            if weak:
                problem, factored, more = without_weak_blocks(problem, state, weak)
                notes += more
                _check(problem, state, factored)
                continue
            bent, cost = after_step(problem, state, trial, found)
            if bent <= LINEAR:
                done = _finished(problem, trial, cost, tuple(history), (*notes, *hardly))
                return replace(done, factored=factored) if linear else done
            reporter.log(f"one more step: an adjusted observation is {bent:.2g} sigma off the linear model")
        if iteration == max_iterations:
            break
        factored.panels.clear()  # no later use; the next factorisation needs the room
        problem, state, factored, damping = _next(problem, state, trial, found, factored, damping, veto, reporter)
        problem, factored, more = _with_runaways_slowed(problem, state, factored)
        notes += more
        _check(problem, state, factored)
    refuse_nearly_singular(problem, state, max_iterations)
    raise ConvergenceError(_failure(records, state, max_iterations, history[-1]), remedy=_ADVICE)


def _next(
    problem: Problem, state: dict[str, Any], trial: dict[str, Any], found: dict[str, Float], factored: Factored,
    damping: Damping, veto: Veto | None, reporter: Reporter,
) -> tuple[Problem, dict[str, Any], Factored, Damping]:  # fmt: skip
    """Take the step or refuse it; an undamped step is judged by the linearisation that the next iteration needs."""
    refused = veto(state, trial) if veto else ""
    before = factored.cost + penalty(problem, state, factored)
    following: Factored | None = None
    then = problem
    if not refused and damping.value == 0.0:
        then = bolder(problem, _decrement(problem, factored))
        following = factorise_constrained(then, trial)
        cost = following.cost + penalty(problem, trial, factored)
        refused = _worse(cost, before)
        if not refused and curvature_of(problem) > 0 and gain(before, cost, factored.decrease) < POOR:
            then = more_cautious(problem)
            following = factorise_constrained(then, trial)
    elif not refused:
        cost = cost_of(problem, trial) + penalty(problem, trial, factored)
        refused = _worse(cost, before)
        if not refused:
            predicted = predicted_decrease(problem, factored, found) + predicted_by_constraints(factored)
            damping = damping.accepted(gain(before, cost, predicted))
            following = factorise_constrained(problem, trial, damping.value)
    if following is not None and not refused:
        return then, trial, following, damping
    reporter.log(f"step refused: {refused}")
    if curvature_of(problem) > 0:
        problem = more_cautious(problem)
    else:
        damping = damping.refused()
    return problem, state, factorise_constrained(problem, state, damping.value), damping


def _with_runaways_slowed(
    problem: Problem, state: State, factored: Factored
) -> tuple[Problem, Factored, list[Note]]:
    """Slow down eliminated blocks that have lost their determination on the way."""
    lost = np.flatnonzero(factored.determined == 0)
    if not len(lost) or problem.rays is None:
        return problem, factored, []
    group = next(u for u in problem.unknowns if u.eliminated)
    names = [str(group.ids[k]) for k in np.sort(problem.rays.block[lost])]
    note = Note("warning", f"has no finite optimum, its rays are parallel: {group.name}", tuple(names))
    hold = problem.hold.copy()
    hold[lost] = HOLD * _size(problem, state, lost)[:, None, None] * np.eye(3)
    slowed = replace(problem, hold=hold)
    return slowed, factorise_constrained(slowed, state, factored.damping), [note]


def _size(problem: Problem, state: State, blocks: Int) -> Float:
    """Trace of the normal matrix of some eliminated blocks."""
    rays = problem.rays
    assert rays is not None
    of_block = [group for group, _ in rays.records.touches].index(problem.layout.eliminated)
    found = np.empty(len(blocks))
    for i, p in enumerate(blocks):
        rows = rays.rows[rays.ray_start[p] : rays.ray_start[p + 1]]
        _, jacobians = whitened(rays.records, state, rows)
        found[i] = (jacobians[of_block] ** 2).sum()
    return found


def _without_observations(problem: Problem) -> list[Note]:
    aside, text = taking_no_part(problem), "takes no part, none of its observations is in use"
    return [
        Note("warning", f"{text}: {u.name}", tuple(str(name) for name, out in zip(u.ids, aside[u.name]) if out))
        for u in problem.unknowns
        if aside[u.name].any()
    ]


def _check(problem: Problem, state: State, factored: Factored) -> None:
    if not np.isfinite(factored.cost):
        raise ConvergenceError("residuals are not finite", remedy=_ADVICE)
    if factored.damping == 0.0 and (factored.weak or (factored.determined == 0).any()):
        refuse_undetermined(problem, state, factored)


def _finished(
    problem: Problem, state: dict[str, Any], cost: float, history: tuple[Step, ...], notes: tuple[Note, ...]
) -> Adjusted:
    problem = with_curvature(problem, 0.0)
    weighted = down_weighted(problem, state)
    observations, n_unknowns, redundancy = counts(problem)
    sigma0 = float(np.sqrt(cost / redundancy)) if redundancy > 0 and not weighted else float("nan")
    return Adjusted(state, problem, cost, observations, n_unknowns, redundancy, sigma0, history, weighted, notes=notes)


_ADVICE = "check the worst observations, or start from better initial values (`from: initial`)"


def _decrement(problem: Problem, factored: Factored) -> float:
    """Newton decrement of all but the blocks that have no finite optimum."""
    runaway = problem.hold[:, 0, 0] > 0
    return float(np.sqrt(max(factored.decrease - float((factored.block_y[runaway] ** 2).sum()), 0.0)))


def _worse(trial: float, cost: float) -> str:
    if not np.isfinite(trial):
        return "residuals are not finite"
    return f"cost rises from {cost:.6g} to {trial:.6g}" if trial > cost * (1 + 1e-10) + 1e-10 else ""


def _failure(records: Sequence[Records], state: State, iterations: int, last: Step) -> str:
    worst = []
    for r in records:
        size = r.standardised(state)
        worst += [(float(size[k]), f"{r.name} row {k}: {size[k]:.1f} sigma") for k in np.argsort(-size)[:5]]
    listed = "; ".join(text for _, text in sorted(worst, reverse=True)[:5])
    return f"no convergence in {iterations} iterations (decrement {last.decrement:.3g}); largest residuals: {listed}"
