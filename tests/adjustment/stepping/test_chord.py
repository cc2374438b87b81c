"""Chord steps: the gradient is that of the state, the factor that of an earlier one; the solution is the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.adjustment.constraints.multipliers import factorise_constrained
from aatri.adjustment.covariance.marginal import marginal_covariances
from aatri.adjustment.elimination.backsolve import steps
from aatri.adjustment.elimination.factor import Factored
from aatri.adjustment.loss import Huber
from aatri.adjustment.stepping import adjust as solve
from aatri.adjustment.stepping.chord import allows_chord, on_earlier_factor
from aatri.adjustment.structure.index_problem import prepare
from aatri.adjustment.unknowns import retract_state
from tests.adjustment.block_problem import joined_problem, made_problem, shared_problem
from tests.adjustment.parts.test_parts import SETTINGS, SIZE, _joint, _same


@pytest.mark.parametrize("made", [made_problem, shared_problem, joined_problem])
def test_at_its_own_state_a_chord_step_is_that_of_the_factorisation(made) -> None:
    unknowns, records, state = made()
    problem = prepare(unknowns, records)
    factored = factorise_constrained(problem, state)
    chord = on_earlier_factor(problem, factored, state)
    assert chord.cost == pytest.approx(factored.cost, rel=1e-12)
    assert chord.decrease == pytest.approx(factored.decrease, rel=1e-10)
    expected = steps(problem, factored, state)
    for name, step in steps(problem, chord, state).items():
        np.testing.assert_allclose(step, expected[name], rtol=1e-8, atol=1e-10 * np.abs(expected[name]).max())


def test_steps_on_an_earlier_factor_lead_to_the_optimum() -> None:
    """From the factor of the start alone, to where Newton's own gradient vanishes."""
    unknowns, records, state = made_problem()
    problem = prepare(unknowns, records)
    first = here = factorise_constrained(problem, state)
    decrements = []
    for _ in range(40):
        state = retract_state(problem.unknowns, state, steps(problem, here, state))
        here = on_earlier_factor(problem, first, state)
        decrements.append(here.decrease**0.5)
    assert here.is_chord
    assert decrements[-1] < 1e-6 * decrements[0]
    assert factorise_constrained(problem, state).decrease ** 0.5 < 1e-6 * decrements[0]


def test_near_the_end_an_adjustment_factorises_no_more(monkeypatch: pytest.MonkeyPatch) -> None:
    """Decrements of 10, 0.17, 0.003: the last iterations share a factor, and end where all others end."""
    monkeypatch.setattr(solve, "QUICK", 0.1)
    unknowns, records, state = made_problem()
    chords: list[Factored] = []

    def counted(problem, earlier, state):
        chords.append(on_earlier_factor(problem, earlier, state))
        return chords[-1]

    monkeypatch.setattr("aatri.adjustment.stepping.iteration.on_earlier_factor", counted)
    with_chords = solve.adjust_large(unknowns, records, state, tolerance=1e-9)
    assert chords
    monkeypatch.setattr(solve, "allows_chord", lambda problem: False)
    without = solve.adjust_large(unknowns, records, state, tolerance=1e-9)
    assert with_chords.cost == pytest.approx(without.cost, rel=1e-12)
    for name, values in without.state.items():
        np.testing.assert_allclose(with_chords.state[name], values, atol=1e-9)


def test_constraints_and_losses_take_a_factorisation_a_step() -> None:
    unknowns, records, _ = made_problem()
    assert allows_chord(prepare(unknowns, records))
    assert not allows_chord(prepare(unknowns, [replace(r, loss=Huber(2.0)) for r in records]))


@pytest.mark.slow(after=1)
def test_chord_steps_of_parts_are_those_of_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """With the whole's steps from the same factors: equal long before the optimum is reached to nine digits."""
    chords: list[Factored] = []

    def counted(problem, earlier, state):
        chords.append(on_earlier_factor(problem, earlier, state))
        return chords[-1]

    monkeypatch.setattr("aatri.adjustment.stepping.iteration.on_earlier_factor", counted)
    monkeypatch.setattr(solve, "QUICK", 0.1)
    unknowns, records, start = problem = made_problem(1, **SIZE)
    whole = solve.adjust_large(unknowns, records, start, settings=replace(SETTINGS, tolerance=1e-2))
    in_the_whole = len(chords)
    in_parts = _joint(problem, 3, tolerance=1e-2)
    assert len(chords) == 4 * in_the_whole > 0
    assert [s.decrement for s in in_parts.history] == pytest.approx([s.decrement for s in whole.history], rel=1e-7)
    _same(in_parts, whole, marginal_covariances(whole))
