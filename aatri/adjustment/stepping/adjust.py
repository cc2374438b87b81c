"""Non-linear least squares of any size: Gauss-Newton with Levenberg-Marquardt fall-back, front by front.

Converged when the Newton decrement of an undamped step is at most `tolerance`, which bounds the step of every unknown
by `tolerance` times its own standard deviation, and the step keeps to the linear model (`linearity`); it is applied. A
step that raises the cost, or that a veto refuses (a point changes its side of the camera), is repeated with damping.
What does not converge is a failure.

An eliminated block that is determined at the start but no longer at a later step has no finite optimum (a point that
runs away along nearly parallel rays): its steps are shortened from then on, it is reported, and it has no covariance.
"""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from aatri.adjustment.constraints.multipliers import factorise_constrained, support
from aatri.adjustment.constraints.stiff import StiffConstraints, stiffened
from aatri.adjustment.elimination.backsolve import steps
from aatri.adjustment.iterative.forecast import within_limit
from aatri.adjustment.openness.set_aside import (
    refuse_nearly_singular,
    refuse_singular,
    without_open_parts,
    without_weak_parts,
)
from aatri.adjustment.others import NotInParts, Others
from aatri.adjustment.problem import ENOUGH, MOST, QUICK, Problem, SolverSettings
from aatri.adjustment.records import Records
from aatri.adjustment.stepping.adjusted import Adjusted, Step
from aatri.adjustment.stepping.chord import allows_chord
from aatri.adjustment.stepping.iteration import (
    IterationState,
    advice_after,
    following,
    goes_on,
    refuse_unusable,
    still_falling,
    with_runaways_slowed,
)
from aatri.adjustment.stepping.kept_iterations import KeptIterations
from aatri.adjustment.stepping.linearity import LINEAR, after_step
from aatri.adjustment.stepping.robust import down_weighted, settled, with_curvature
from aatri.adjustment.stepping.runaways import Veto, steadied
from aatri.adjustment.structure.index_problem import indexed
from aatri.adjustment.structure.indexed_problem import IndexedProblem, counts
from aatri.adjustment.structure.weights import taking_no_part
from aatri.adjustment.unknowns import State, Unknowns, retract_state
from aatri.arrays import Float
from aatri.errors import ConvergenceError
from aatri.ids import several
from aatri.notes import Note
from aatri.progress import SILENT, Reporter, tell_iteration

Curve = Callable[[State, State, Mapping[str, Float]], dict[str, Any]]

ROUGH = 0.1
"""Tolerance from which on a robust solution only selects: reweighted least squares may end it."""


def adjust_large(
    unknowns: Sequence[Unknowns],
    records: Sequence[Records],
    start: State,
    *,
    constraints: Sequence[Records] = (),
    settings: SolverSettings | None = None,
    veto: Veto | None = None,
    curve: Curve | None = None,
    reporter: Reporter = SILENT,
    **changed: Any,
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
    settings : SolverSettings, optional
    veto : callable, optional
    curve : callable, optional
        (old, new, step) -> the new state with what the blocks of unknowns do together beyond first order.
    reporter : Reporter
        Of the progress.
    **changed
        SolverSettings that differ from `settings`.

    Raises
    ------
    GeometryError
        If unknowns are not determined; the message names them.
    ConvergenceError
        If the iteration does not converge; the message names the worst records.
    """
    settings = replace(settings or SolverSettings(), **changed)
    stiff = stiffened(unknowns, records, constraints, start)
    if stiff.records:
        records, constraints = (*records, *stiff.records), ()
    stated = Problem(tuple(unknowns), tuple(records), tuple(constraints))
    here, notes = _begun(stated, settings, start, stiff, reporter)
    linear, joint_veto = _is_linear(here, settings.others), _veto_of_all(veto, settings.others)
    chord = allows_chord(here.problem)
    kept = KeptIterations(settings.checkpoint, start)
    history = list[Step]()
    redundancy = counts(here.problem)[2]
    if (latest := kept.latest(here)) is not None:
        here.factored.clear()
        here, history, notes = latest
    for iteration in itertools.count(len(history) + 1):
        problem, factored = here.problem, here.factored
        step = steps(problem, factored, here.state)
        history.append(Step(factored.cost, here.decrement, factored.damping))
        tell_iteration(reporter, iteration, factored.cost, redundancy, here.decrement, here.damping.value)
        trial = retract_state(problem.unknowns, here.state, step)
        trial = steadied(problem, curve(here.state, trial, step) if curve else trial, veto)
        if _may_end(here, _bound(settings, history), linear=linear):
            end = _end(here, trial, step, history, notes, stiff, reporter, linear=linear)
            if isinstance(end, Adjusted):
                return end
            if end is not None:
                here, more = end
                notes = [*notes, *more]
                refuse_unusable(here)
                continue
        if _gives_up(history, iteration, settings.max_iterations):
            break
        by_chord = chord and _is_near(history)
        if not by_chord:
            factored.clear()  # no later use; the next factorisation needs the room
        here = following(here, trial, step, joint_veto, reporter, by_chord=by_chord)
        here, more = with_runaways_slowed(here)
        history[-1] = replace(history[-1], strayed=here.strayed)
        notes += more
        refuse_unusable(here)
        if not here.factored.is_chord:
            kept.keep(here, history, notes)
    if settings.others is not None:
        raise NotInParts(f"no convergence in {len(history)} iterations")
    refuse_nearly_singular(here.problem, here.state, len(history), still_falling(history))
    raise ConvergenceError(
        _failure(here.problem.records, here.state, len(history), history[-1]), remedy=advice_after(history)
    )


def _begun(
    stated: Problem, settings: SolverSettings, start: State, stiff: StiffConstraints, reporter: Reporter
) -> tuple[IterationState, list[Note]]:
    """The first factorisation, without what is open."""
    problem = indexed(stated, settings, support(stated.unknowns, stated.records, stated.constraints, start))
    problem = within_limit(problem, reporter)
    notes = [*_without_observations(problem), *stiff.notes()]
    problem, factored, more = without_open_parts(problem, start, factorise_constrained(problem, start))
    here = IterationState(problem, dict(start), factored)
    refuse_unusable(here)
    if not factored.factor.is_direct:
        refuse_singular(problem, start)
    return here, [*notes, *more]


def _bound(settings: SolverSettings, history: Sequence[Step]) -> float:
    """Of the decrement of the last step; with the last iteration that is allowed, `tolerance`."""
    if settings.near_tolerance is None or len(history) >= (settings.max_iterations or ENOUGH):
        return settings.tolerance
    return settings.near_tolerance if _is_near(history) else settings.tolerance


def _is_near(history: Sequence[Step]) -> bool:
    """Whether undamped steps have become so much shorter that the next is expected to as well."""
    return len(history) > 1 and history[-1].decrement < QUICK * history[-2].decrement and history[-1].damping == 0.0


def _may_end(here: IterationState, tolerance: float, *, linear: bool) -> bool:
    """Whether the step from here is the last one, if it keeps to the linear model."""
    if here.factored.damping != 0.0 or not (linear or here.decrement <= tolerance):
        return False
    return tolerance >= ROUGH or settled(here.problem, here.state)


def _end(
    here: IterationState,
    trial: dict[str, Any],
    step: dict[str, Float],
    history: Sequence[Step],
    notes: Sequence[Note],
    stiff: StiffConstraints,
    reporter: Reporter,
    *,
    linear: bool,
) -> Adjusted | tuple[IterationState, Sequence[Note]] | None:
    """The result, if the step is the last one; where to go on without weak parts; None if a further step is due."""
    weak = without_weak_parts(here.problem, here.state, here.factored)
    if isinstance(weak, tuple):
        problem, factored, more = weak
        return IterationState(problem, here.state, factored), more
    bent, cost = after_step(here.problem, here.state, trial, step)
    if bent > LINEAR:
        reporter.log(f"one more step: an adjusted observation is {bent:.2g} sigma off the linear model")
        return None
    stiff.refuse_violated(trial)
    done = _finished(here.problem, trial, cost, tuple(history), (*notes, *weak))
    done = replace(done, observations=done.observations - stiff.count)
    return replace(done, factored=here.factored) if linear else done


def _is_linear(here: IterationState, others: Others | None) -> bool:
    """Whether one step is enough, in all parts."""
    linear = here.factored.factor.is_direct and all(r.linear and r.loss is None for r in here.problem.records)
    return linear if others is None else others.total(float(not linear)) == 0.0


def _gives_up(history: Sequence[Step], iteration: int, max_iterations: int | None) -> bool:
    if max_iterations is None and iteration == ENOUGH and not goes_on(history):
        return True
    return iteration >= (max_iterations or MOST)


def _veto_of_all(veto: Veto | None, others: Others | None) -> Veto | None:
    if others is None:
        return veto
    return lambda old, new: others.first(veto(old, new) if veto is not None else "")


def _without_observations(problem: IndexedProblem) -> list[Note]:
    no_part, text = taking_no_part(problem), "takes no part, none of its observations is in use"
    return [
        Note("warning", f"{text}: {u.name}", tuple(str(name) for name, out in zip(u.ids, no_part[u.name]) if out))
        for u in problem.unknowns
        if no_part[u.name].any()
    ]


def _finished(
    problem: IndexedProblem, state: dict[str, Any], cost: float, history: tuple[Step, ...], notes: tuple[Note, ...]
) -> Adjusted:
    problem = with_curvature(problem, 0.0)
    weighted = down_weighted(problem, state)
    observations, n_unknowns, redundancy = counts(problem)
    sigma0 = float(np.sqrt(cost / redundancy)) if redundancy > 0 and not weighted else float("nan")
    return Adjusted(state, problem, cost, observations, n_unknowns, redundancy, sigma0, history, weighted, notes=notes)


def _failure(records: Sequence[Records], state: State, iterations: int, last: Step) -> str:
    worst = []
    for r in records:
        size = r.standardised(state)
        worst += [(float(size[k]), f"{r.called(int(k))}: {size[k]:.1f} sigma") for k in np.argsort(-size)[:5]]
    listed = "; ".join(text for _, text in sorted(worst, reverse=True)[:5])
    count = several(iterations, "iteration")
    return f"no convergence in {count} (decrement {last.decrement:.3g}); largest residuals: {listed}"
