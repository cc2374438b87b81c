"""The linearisation test of the last step."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.adjustment.stepping import adjust as solve
from aatri.adjustment.stepping.linearity import after_step
from aatri.adjustment.structure.index_problem import prepare
from aatri.adjustment.unknowns import retract_state
from tests.adjustment.block_problem import made_problem


def test_the_departure_is_that_of_second_order() -> None:
    """Twice the step, four times the departure; none without a step."""
    unknowns, records, state = made_problem()
    problem = prepare(unknowns, records)
    rng = np.random.default_rng(0)
    away = {u.name: rng.normal(size=u.free.shape) * u.free for u in unknowns}
    state = retract_state(problem.unknowns, state, away)  # at the start the second derivatives are zero
    step = {u.name: 1e-3 * rng.normal(size=u.free.shape) * u.free for u in unknowns}
    found = []
    for factor in (0.0, 1.0, 2.0):
        scaled = {name: factor * s for name, s in step.items()}
        found.append(after_step(problem, state, retract_state(problem.unknowns, state, scaled), scaled)[0])
    assert found[0] == 0.0
    assert found[1] > 0
    assert found[2] / found[1] == pytest.approx(4.0, rel=0.05)


def test_a_step_that_leaves_the_linear_model_is_followed_by_another(monkeypatch: pytest.MonkeyPatch) -> None:
    unknowns, records, state = made_problem()
    before = solve.adjust_large(unknowns, records, state, tolerance=10.0)
    monkeypatch.setattr(solve, "LINEAR", 1e-14)
    after = solve.adjust_large(unknowns, records, state, tolerance=10.0)
    assert len(after.history) > len(before.history)
    assert after.history[-1].decrement < before.history[-1].decrement
