"""The front-by-front solver against a dense reference."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from aatri.adjustment.covariance.marginal import marginal_covariances
from aatri.adjustment.elimination import schedule as shares
from aatri.adjustment.records import Records
from aatri.adjustment.stepping.adjust import adjust_large
from aatri.adjustment.stepping.adjusted import Adjusted, Step
from aatri.adjustment.stepping.iteration import advice_after, goes_on
from aatri.adjustment.structure import graph as graphs
from aatri.adjustment.structure import index_problem as preparation
from aatri.adjustment.structure import minimum_degree as degrees
from aatri.adjustment.structure.index_problem import Ordering
from aatri.adjustment.unknowns import Unknowns, add_step
from aatri.errors import ConvergenceError, GeometryError
from tests.adjustment.block_problem import halves_problem, joined_problem, made_problem, shared_problem
from tests.adjustment.reference import dense_jacobian, free_columns

ORDERINGS: tuple[Ordering, ...] = ("auto", "nested_dissection", "minimum_degree", "across_strips", "along_strips")
MAKERS = {"plain": made_problem, "joined": joined_problem, "shared": shared_problem}


def _many_fronts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Small problems on a tree of many small fronts, shared out among threads."""
    monkeypatch.setattr(shares, "PARALLEL_FLOPS", 0.0)
    monkeypatch.setattr(preparation, "DENSE_VERTICES", 2)
    monkeypatch.setattr(graphs, "LEAF", 3)
    for where, name in ((preparation, "nested_dissection"), (degrees, "minimum_degree")):
        monkeypatch.setattr(where, name, _with_small_nodes(getattr(where, name)))


def _with_small_nodes(order):
    return lambda graph, arrangement: order(graph, arrangement, 3)


def _reference(unknowns, records, start):
    """Gauss-Newton on the dense Jacobian, by numpy's least squares."""
    state = {k: x.copy() for k, x in start.items()}
    columns = free_columns(unknowns)
    for _ in range(30):
        J, v = dense_jacobian(unknowns, records, state)
        dx = np.append(np.linalg.lstsq(J, -v, rcond=None)[0], 0.0)
        for u in unknowns:
            state[u.name] = state[u.name] + dx[columns[u.name]]
    return state


@cache
def _reference_of(maker: str, seed: int):
    """The same for all orders of elimination."""
    return _reference(*_problem(maker, seed))


def _problem(maker: str, seed: int):
    return MAKERS[maker](seed, n_kept=14, n_points=40)


def _expected_covariances(unknowns, records, state):
    J, _ = dense_jacobian(unknowns, records, state)
    Q = np.linalg.inv(J.T @ J)
    padded = np.pad(Q, (0, 1))
    return {u.name: padded[c[:, :, None], c[:, None, :]] for u, c in zip(unknowns, free_columns(unknowns).values())}


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("fronts", ["one", "many"])
@pytest.mark.parametrize("ordering", ORDERINGS)
@pytest.mark.parametrize("maker", MAKERS)
@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))])
def test_solution_and_covariances_equal_the_dense_reference(
    monkeypatch: pytest.MonkeyPatch, seed: int, maker: str, ordering: Ordering, fronts: str
) -> None:
    if fronts == "many":
        _many_fronts(monkeypatch)
    unknowns, records, start = _problem(maker, seed)
    result = adjust_large(unknowns, records, start, tolerance=1e-9, ordering=ordering, threads=2)
    assert (len(result.problem.tree.nodes) > 2) == (fronts == "many")
    for name, value in _reference_of(maker, seed).items():
        np.testing.assert_allclose(result.state[name], value, atol=1e-9)
    found = marginal_covariances(result).groups
    for name, expected in _expected_covariances(unknowns, records, result.state).items():
        np.testing.assert_allclose(found[name], expected, rtol=1e-8, atol=1e-12)


@pytest.mark.parametrize("threads", [1, 2])
def test_a_front_of_one_scalar_is_a_front(monkeypatch: pytest.MonkeyPatch, threads: int) -> None:
    _many_fronts(monkeypatch)
    unknowns, records, start = halves_problem()
    result = adjust_large(unknowns, records, start, tolerance=1e-9, ordering="nested_dissection", threads=threads)
    assert result.problem.tree.nodes[-1].size == 2  # c and a held column
    for name, value in _reference(unknowns, records, start).items():
        np.testing.assert_allclose(result.state[name], value, atol=1e-9)
    found = marginal_covariances(result).groups
    for name, expected in _expected_covariances(unknowns, records, result.state).items():
        np.testing.assert_allclose(found[name], expected, rtol=1e-8, atol=1e-12)


@pytest.mark.parametrize("maker", MAKERS)
def test_redundancy_numbers_of_the_rays_are_those_of_the_dense_projector(
    monkeypatch: pytest.MonkeyPatch, maker: str
) -> None:
    _many_fronts(monkeypatch)
    unknowns, records, start = MAKERS[maker](1, n_kept=14, n_points=40)
    result = adjust_large(unknowns, records, start)
    J, _ = dense_jacobian(unknowns, records, result.state)
    hat = np.diag(J @ np.linalg.inv(J.T @ J) @ J.T)[: 2 * len(records[0].active)].reshape(-1, 2)
    rays = np.einsum("nii->ni", marginal_covariances(result).rays)
    known = records[0].active
    np.testing.assert_allclose(rays[known], hat[known], rtol=1e-8, atol=1e-12)


def test_held_scalars_keep_their_value_and_have_no_variance() -> None:
    unknowns, records, start = made_problem()
    result = adjust_large(unknowns, records, start)
    assert result.state["a"][1, 2] == 0.0
    assert (result.state["p"][7] == 0.0).all()
    found = marginal_covariances(result).groups
    assert (found["a"][1, 2] == 0).all()
    assert (found["p"][7] == 0).all()


def test_counts_are_those_of_free_unknowns_and_active_observations() -> None:
    unknowns, records, start = made_problem()
    result = adjust_large(unknowns, records, start)
    assert result.observations == 2 * (36 - 1) + 5 * 4
    assert result.n_unknowns == 5 * 4 - 1 + 12 * 3 - 4
    assert result.redundancy == result.observations - result.n_unknowns
    assert result.sigma0 == pytest.approx(np.sqrt(result.cost / result.redundancy))


def test_the_same_bits_every_time_and_for_any_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    _many_fronts(monkeypatch)
    unknowns, records, start = made_problem(2, n_kept=14, n_points=40)

    def run(threads: int) -> Adjusted:
        return adjust_large(unknowns, records, start, threads=threads, reproducible=True)

    first = run(1)
    for threads in (1, 2, 3):
        again = run(threads)
        assert (again.state["a"] == first.state["a"]).all()
        assert (again.state["p"] == first.state["p"]).all()


def _switched_off(records, touch: int, block: int):
    rays = records[0]
    active = rays.active & (rays.touches[touch][1] != block)
    return type(rays)(rays.name, rays.touches, rays.evaluate, rays.whitener, active)


def test_an_open_kept_unknown_is_named() -> None:
    unknowns, records, start = made_problem()
    # without the prior and with the rays of block a0 switched off nothing determines it
    off = _switched_off(records, 0, 0)
    with pytest.raises(GeometryError, match="a0"):
        adjust_large(unknowns, (off,), start)


def test_an_open_kept_unknown_of_a_large_problem_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    _many_fronts(monkeypatch)
    monkeypatch.setattr("aatri.adjustment.openness.null_vectors.WHOLE", 0)
    unknowns, records, start = made_problem(3, n_kept=14, n_points=40)
    off = _switched_off(records, 0, 5)
    records[1].active[5] = False
    with pytest.raises(GeometryError, match="a a5"):
        adjust_large(unknowns, (off, records[1]), start)


def test_an_open_point_is_set_aside_by_name() -> None:
    unknowns, records, start = made_problem()
    off = _switched_off(records, 1, 9)
    off.active[np.flatnonzero(records[0].touches[1][1] == 9)[0]] = True  # one ray is not enough
    result = adjust_large(unknowns, (off, records[1]), start)
    assert [str(note) for note in result.notes] == ["set aside, its observations do not determine it: p p9"]
    without = _switched_off(records, 1, 9)
    expected = adjust_large(unknowns, (without, records[1]), start)
    np.testing.assert_allclose(result.state["a"], expected.state["a"], atol=1e-8)


def test_no_convergence_is_a_failure_that_names_the_worst_records() -> None:
    unknowns, records, start = made_problem()
    with pytest.raises(ConvergenceError, match="ray row"):
        adjust_large(unknowns, records, start, max_iterations=1)


@pytest.mark.parametrize(("last", "advice"), [(900.0, "still falls, by 10 %"), (999.5, "check the worst")])
def test_what_makes_progress_is_told_to_go_on(last: float, advice: str) -> None:
    history = [Step(cost, 3.0, 1e-3) for cost in (1500.0, 1000.0, *np.linspace(1000.0, last, 6)[1:])]
    assert advice in advice_after(history)


def test_steps_that_shrink_go_on_where_the_sum_of_squares_hardly_falls() -> None:
    costs, bent = np.linspace(1020.72, 1020.70, 6), [0.088, 0.076, 0.056, 0.044, 0.026, 0.014]
    history = [Step(cost, decrement, 1e-8) for cost, decrement in zip(costs, bent)]
    assert goes_on(history)
    assert not goes_on([replace(step, decrement=0.05) for step in history])


def creeping(iterations: int) -> tuple[list[Unknowns], list[Records], dict[str, Any]]:
    """v = e^x, of which a step takes no more than 1 off x: so many of them until v is 1."""

    def evaluate(state: Any, rows: Any) -> tuple[Any, tuple[Any, ...]]:
        v = np.exp(state["a"][rows])
        return v, (v[:, :, None],)

    records = Records("slow", (("a", np.zeros(1, dtype=np.int32)),), evaluate, np.ones((1, 1)), np.ones(1, dtype=bool))
    unknowns = Unknowns("a", np.ones((1, 1), dtype=bool), ("x",), ("0",), add_step)
    return [unknowns], [records], {"a": np.full((1, 1), float(iterations))}


def test_an_adjustment_that_makes_progress_goes_on_where_no_number_of_iterations_is_stated() -> None:
    problem = creeping(40)
    with pytest.raises(ConvergenceError, match="in 30 iterations") as stopped:
        adjust_large(*problem, max_iterations=30)
    assert "still falls" in stopped.value.remedy
    assert 40 < len(adjust_large(*problem).history) <= 60
    with pytest.raises(ConvergenceError, match="in 60 iterations"):
        adjust_large(*creeping(80))


def test_a_vetoed_step_is_damped() -> None:
    unknowns, records, start = made_problem()
    vetoes = iter(["too far", "still too far"])
    result = adjust_large(unknowns, records, start, veto=lambda old, new: next(vetoes, ""))
    assert [s.damping > 0 for s in result.history][:3] == [False, True, True]
    np.testing.assert_allclose(result.state["a"], _reference(unknowns, records, start)["a"], atol=1e-4)
