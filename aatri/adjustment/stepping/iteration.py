"""One iteration: what it stands on, and how it goes to the next, by a step that is taken, damped or refused."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from aatri.adjustment.constraints.multipliers import factorise_constrained, penalty, predicted_by_constraints
from aatri.adjustment.elimination.backsolve import cost_of, predicted_decrease
from aatri.adjustment.elimination.factor import Factored
from aatri.adjustment.openness.set_aside import refuse_undetermined
from aatri.adjustment.openness.weighted_datum import is_singular
from aatri.adjustment.records import whitened
from aatri.adjustment.stepping.adjusted import Step
from aatri.adjustment.stepping.chord import on_earlier_factor
from aatri.adjustment.stepping.damping import Damping, gain
from aatri.adjustment.stepping.robust import POOR, bolder, curvature_of, more_cautious
from aatri.adjustment.stepping.runaways import Veto, all_steadied
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.unknowns import State
from aatri.arrays import Float, Int
from aatri.errors import ConvergenceError
from aatri.notes import Note
from aatri.progress import Reporter

HOLD = 1e-9
"""Share of its own normal matrix by which the steps of a block without finite optimum are shortened."""

ADVICE = "check the worst observations, or start from better initial values (`from: initial`)"

LATELY = 5
"""Iterations over which progress is judged."""


@dataclass(frozen=True)
class IterationState:
    """What an iteration stands on."""

    problem: IndexedProblem
    """With the curvature of its losses and the blocks slowed down so far."""
    state: dict[str, Any]
    """Values of all groups."""
    factored: Factored
    """The linearisation there."""
    damping: Damping = Damping()
    strayed: bool = False
    """The step to here was not the linear one."""

    @property
    def decrement(self) -> float:
        """Newton decrement of all but the blocks that have no finite optimum."""
        runaway = self.problem.hold[:, 0, 0] > 0
        own = float((self.factored.block_y[runaway] ** 2).sum())
        return float(np.sqrt(max(self.factored.decrease - own, 0.0)))


def following(
    here: IterationState,
    trial: dict[str, Any],
    step: dict[str, Float],
    veto: Veto | None,
    reporter: Reporter,
    *,
    by_chord: bool = False,
) -> IterationState:
    """Take the step or refuse it; an undamped step is judged by the linearisation that the next iteration needs.

    A step that is damped or would be refused is taken with every eliminated block at its own optimum after it.

    Parameters
    ----------
    trial : dict
        The state after the step.
    step : dict of str to (n, k) float64
        The step.
    by_chord : bool
        The factor of here serves the next step too.
    """
    problem, factored, damping = here.problem, here.factored, here.damping
    before = _cost(here, here.state, factored.cost)
    refused = veto(here.state, trial) if veto else ""
    if not refused and damping.value == 0.0:
        then = bolder(problem, here.decrement)
        next_ = on_earlier_factor(then, factored, trial) if by_chord else factorise_constrained(then, trial)
        cost = _cost(here, trial, next_.cost)
        refused = _worse(cost, before)
        if not refused and curvature_of(problem) > 0 and gain(before, cost, factored.decrease) < POOR:
            then = more_cautious(problem)
            next_ = factorise_constrained(then, trial)
        if not refused:
            return IterationState(then, trial, next_, damping)
    if by_chord:
        factored.clear()  # there is no room for two
    for bold in (True, False) if damping.value > 0.0 else (True,):
        after = all_steadied(problem, trial) if bold and not problem.constraints else trial
        cost = _cost(here, after, cost_of(problem, after))
        reason = (veto(here.state, after) if veto else "") or _worse(cost, before)
        if not reason:
            if damping.value > 0.0:
                predicted = predicted_decrease(problem, factored, step) + predicted_by_constraints(factored)
                damping = damping.accepted(gain(before, cost, predicted))
            factored = factorise_constrained(problem, after, damping.value)
            return IterationState(problem, after, factored, damping, strayed=True)
        refused = refused or reason
    reporter.log(f"step refused: {refused}")
    if curvature_of(problem) > 0:
        problem = more_cautious(problem)
    else:
        damping = damping.refused()
    factored = factorise_constrained(problem, here.state, damping.value)
    return IterationState(problem, here.state, factored, damping, strayed=True)


def falls(history: Sequence[Step]) -> bool:
    """Whether v'v has lately fallen by more than one observation contributes."""
    return len(history) > LATELY and history[-1 - LATELY].cost - history[-1].cost > 1.0


def goes_on(history: Sequence[Step]) -> bool:
    """Whether v'v still falls, or its steps have lately become less than half: along a bent valley it hardly falls."""
    shrinks = len(history) > LATELY and history[-1].decrement < 0.5 * history[-1 - LATELY].decrement
    return shrinks or falls(history)


def advice_after(history: Sequence[Step]) -> str:
    """What to do after too few iterations: go on where v'v still falls."""
    nearer = "or start nearer (`from: initial`, parameters from the data sheet or held at first)"
    return f"{falling}, {nearer}" if (falling := still_falling(history)) else ADVICE


def still_falling(history: Sequence[Step]) -> str:
    """That v'v still falls, and what to do then; empty where it does not."""
    if not falls(history):
        return ""
    share = 100 * (1.0 - history[-1].cost / history[-1 - LATELY].cost)
    what = f"the sum of squares still falls, by {share:.2g} % in the last {LATELY} iterations"
    return f"{what}: allow more (`max_iterations`)"


def _cost(here: IterationState, state: State, cost: float) -> float:
    """Cost of a state and what it violates of the constraints."""
    return cost + penalty(here.problem, state, here.factored)


def with_runaways_slowed(here: IterationState) -> tuple[IterationState, list[Note]]:
    """Slow down eliminated blocks that have lost their determination on the way."""
    problem, lost = here.problem, np.flatnonzero(here.factored.determined == 0)
    if not len(lost) or problem.rays is None:
        return here, []
    group = next(u for u in problem.unknowns if u.eliminated)
    names = tuple(str(group.ids[k]) for k in np.sort(problem.rays.block[lost]))
    note = Note("warning", f"has no finite optimum, its rays are parallel: {group.name}", names, sets_aside=True)
    hold = problem.hold.copy()
    hold[lost] = HOLD * _size(problem, here.state, lost)[:, None, None] * np.eye(3)
    slowed = replace(problem, hold=hold)
    here.factored.clear()
    factored = factorise_constrained(slowed, here.state, here.factored.damping)
    return replace(here, problem=slowed, factored=factored), [note]


def refuse_unusable(here: IterationState) -> None:
    """Raise if no step can be taken from here.

    Raises
    ------
    ConvergenceError
        If residuals are not finite.
    GeometryError
        If unknowns are not determined.
    """
    factored = here.factored
    if not np.isfinite(factored.cost):
        raise ConvergenceError("residuals are not finite", remedy=ADVICE)
    if factored.damping == 0.0 and is_singular(here.problem, here.state, factored):
        refuse_undetermined(here.problem, here.state, factored)


def _size(problem: IndexedProblem, state: State, blocks: Int) -> Float:
    """Trace of the normal matrix of some eliminated blocks."""
    rays = problem.rays
    assert rays is not None
    of_block = [group for group, _ in rays.records.touches].index(problem.layout.eliminated)
    trace = np.empty(len(blocks))
    for i, p in enumerate(blocks):
        rows = rays.rows[rays.ray_start[p] : rays.ray_start[p + 1]]
        _, jacobians = whitened(rays.records, state, rows)
        trace[i] = (jacobians[of_block] ** 2).sum()
    return trace


def _worse(trial: float, cost: float) -> str:
    if not np.isfinite(trial):
        return "residuals are not finite"
    return f"cost rises from {cost:.6g} to {trial:.6g}" if trial > cost * (1 + 1e-10) + 1e-10 else ""
