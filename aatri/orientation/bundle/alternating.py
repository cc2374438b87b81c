"""Bundle adjustment by alternation: all images by resection, all points by intersection, in turn.

Each half makes the same sum of squares smaller, with the other half held, and falls into one small problem per image
or point. It comes near the bundle slowly: by a constant factor a round, the nearer to 1 the more images a point ties.
It has ended when the Newton step of the whole block is below the tolerance (Newton decrement sqrt(g'dx)), which is
looked at every few rounds; every few rounds, too, it is tried to go on along the last move. sigma0 is that of the
bundle then. There are no standard deviations: those of the halves leave out what the other half would move.

Source: lecture notes A908 (two-class approximation); docs/formulas.md 4.5.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from aatri.adjustment.constraints.multipliers import factorise_constrained
from aatri.adjustment.elimination.backsolve import cost_of, steps
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.unknowns import State, retract_state
from aatri.arrays import Float
from aatri.errors import ConvergenceError
from aatri.ids import several
from aatri.notes import Note
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bundle.adjust import adjust_bundle
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.partial import of_unknown
from aatri.orientation.bundle.result import BundleResult, from_result
from aatri.orientation.bundle.settings import BundleSettings
from aatri.progress import SILENT, Reporter

EVERY = 5
"""Rounds between two looks at the whole block, at first; later as many as have been made already."""


def adjust_alternating(
    inputs: BundleInput, settings: BundleSettings, *, max_rounds: int, reporter: Reporter = SILENT
) -> BundleResult:
    """Adjust a block by alternation.

    Raises
    ------
    ConvergenceError
        If the whole block has not converged after so many rounds.
    """
    half_settings = replace(settings, covariances=False)
    whole_settings = replace(half_settings, solution=replace(settings.solution, max_iterations=1))
    images, points = np.ones(len(inputs.image_ids), dtype=bool), np.ones(len(inputs.point_ids), dtype=bool)
    resected = adjust_bundle(replace(of_unknown(inputs, POSE), held_points=points), half_settings)
    start = of_unknown(from_result(inputs, resected), POINT)
    intersected = adjust_bundle(replace(start, held_images=images), half_settings)
    halves = resected.adjusted.problem, intersected.adjusted.problem
    state, next_check, previous = intersected.adjusted.state, EVERY, _Move({}, 0.0)
    for round_number in range(1, max_rounds + 1):
        reporter.progress(round_number, max_rounds, "rounds of resection and intersection")
        if round_number in (next_check, max_rounds):
            current = replace(intersected, adjusted=replace(intersected.adjusted, state=state))
            try:
                result = adjust_bundle(from_result(inputs, current), whole_settings)
            except ConvergenceError:
                next_check += max(EVERY, round_number // 2)
            else:
                note = Note(
                    "note", f"{several(round_number, 'round')} of resection and intersection; no standard deviations"
                )
                return replace(result, notes=(*result.notes, note))
        state, move = _round(halves, state)
        if round_number % EVERY == 0:
            state = _farther(halves, state, move, previous)
        previous = move
    raise ConvergenceError(
        f"resection and intersection in turn have not converged in {max_rounds} rounds",
        remedy="raise max_rounds, or adjust with bundle_adjustment/bundle",
    )


@dataclass(frozen=True)
class _Move:
    """Steps of one round by group, and the length of the next along it that the linear model would have them take."""

    step: dict[str, Float]
    square: float


def _round(halves: tuple[IndexedProblem, ...], state: State) -> tuple[dict[str, Any], _Move]:
    """A Gauss-Newton step of all images, then one of all points; the first round has solved both already."""
    moved: dict[str, Float] = {}
    current, square = dict(state), 0.0
    for half in halves:
        factored = factorise_constrained(half, current)
        step = steps(half, factored, current)
        current = retract_state(half.unknowns, current, step)
        moved = {name: moved.get(name, 0.0) + part for name, part in step.items()}
        square += factored.decrease
    return current, _Move(moved, square)


def _farther(halves: tuple[IndexedProblem, ...], state: State, move: _Move, previous: _Move) -> dict[str, Any]:
    """The state moved on along the last round, if that makes the sum of squares smaller (Aitken's extrapolation).

    Moves that shrink by a factor q a round add up to q / (1 - q) of the last; q^2 is the ratio of what two rounds in
    turn gain.
    """
    current = dict(state)
    q = float(np.sqrt(move.square / previous.square)) if previous.square > 0 else 0.0
    if not 0.0 < q < 1.0:
        return current
    unknowns, problem = halves[0].unknowns, halves[1]
    cost_before = cost_of(problem, current)
    for share in (1.0, 0.5, 0.25):
        step = {name: share * q / (1.0 - q) * part for name, part in move.step.items()}
        extrapolated = retract_state(unknowns, current, step)
        if cost_of(problem, extrapolated) < cost_before:
            return extrapolated
    return current
