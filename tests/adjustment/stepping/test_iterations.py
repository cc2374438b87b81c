"""From iteration to iteration: linearity, runaways."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.adjusting.acceleration import accelerated
from aatri.adjustment.elimination.backsolve import cost_of
from aatri.adjustment.problem import Problem, SolverSettings
from aatri.adjustment.records import whitened
from aatri.adjustment.stepping import adjust as solve
from aatri.adjustment.stepping import runaways
from aatri.adjustment.stepping.linearity import after_step
from aatri.adjustment.stepping.runaways import all_steadied
from aatri.adjustment.structure.index_problem import indexed, prepare
from aatri.adjustment.unknowns import retract_state
from tests.adjustment.block_problem import joined_problem, made_problem

# The linearisation test of the last step.


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


@pytest.mark.parametrize(("most", "iterations"), [(None, 3), (3, 3), (2, 2)])
def test_a_coarse_adjustment_goes_to_its_end_where_that_is_near_and_iterations_are_left(
    most: int | None, iterations: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Decrements of 10, 0.17, 0.003: the second is enough for `tolerance`, the third for `near_tolerance`."""
    unknowns, records, state = made_problem()
    monkeypatch.setattr(solve, "LINEAR", 1.0)
    assert len(solve.adjust_large(unknowns, records, state, tolerance=5.0).history) == 2
    near = {"tolerance": 5.0, "near_tolerance": 0.01, "max_iterations": most}
    assert len(solve.adjust_large(unknowns, records, state, **near).history) == 2  # each is not a hundredth
    monkeypatch.setattr(solve, "QUICK", 0.1)
    assert len(solve.adjust_large(unknowns, records, state, **near).history) == iterations


# Eliminated blocks at their own optimum, held against dense algebra over the records that touch them.


@pytest.mark.parametrize("maker", [made_problem, joined_problem])
@pytest.mark.parametrize("rays_at_a_time", [7, 100_000])
def test_every_block_is_at_the_optimum_of_its_own_records_and_nothing_else_has_moved(
    maker, rays_at_a_time: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(runaways, "RAYS_AT_A_TIME", rays_at_a_time)
    unknowns, records, start = maker(2, n_kept=8, n_points=20)
    rng = np.random.default_rng(1)
    free = {u.name: u.free for u in unknowns}
    far = {name: value + free[name] * rng.normal(size=value.shape) for name, value in start.items()}
    problem = indexed(Problem(tuple(unknowns), tuple(records)), SolverSettings())
    steadied = all_steadied(problem, far)
    assert cost_of(problem, steadied) < cost_of(problem, far)
    for name in far:
        held = np.ones_like(free[name]) if name != "p" else ~free[name]
        np.testing.assert_array_equal(np.asarray(steadied[name])[held], np.asarray(far[name])[held])
    gradient, normal = np.zeros((20, 3)), np.zeros((20, 3, 3))
    for r in records:
        for (group, block), J in zip(r.touches, whitened(r, steadied, np.arange(len(r.active)))[1]):
            if group == "p":
                v = whitened(r, steadied, np.arange(len(r.active)))[0]
                np.add.at(gradient, block, np.einsum("nij,ni->nj", J, v))
                np.add.at(normal, block, np.einsum("nij,nik->njk", J, J))
    off = np.abs(gradient) / np.sqrt(np.einsum("nii->ni", normal))  # in standard deviations of a scalar by itself
    assert off[free["p"]].max() < 1e-3


def test_steps_that_shrink_slowly_along_several_modes_are_summed_up() -> None:
    """x <- x + f along 40 modes, three of them slow: 0.97^k = 1e-8 takes k = 600; unknowns are of unlike size."""
    rng = np.random.default_rng(3)
    shrinking = np.concatenate([[0.97, 0.95, 0.9], rng.uniform(0.0, 0.2, 37)])
    modes, limit = np.linalg.qr(rng.normal(size=(40, 40)))[0], rng.normal(size=40)
    size = np.tile([1.0, 1e-6], 20)
    steps, taken, x = list[dict[str, np.ndarray]](), list[dict[str, np.ndarray]](), np.zeros(40)
    for _ in range(20):
        f = modes @ ((shrinking - 1.0) * (modes.T @ (x - limit)))
        steps.append({"a": (size * f).reshape(20, 2)})
        taken.append(accelerated(steps[-6:], taken[-5:]) if len(steps) > 1 else steps[0])
        x = x + taken[-1]["a"].ravel() / size
    np.testing.assert_allclose(x, limit, atol=1e-8)
