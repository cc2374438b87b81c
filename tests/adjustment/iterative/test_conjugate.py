"""Conjugate gradients: the direct solution, with as much or as little of the factor as there is room for."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.adjustment.covariance.cross import covariances_of_pairs
from aatri.adjustment.covariance.marginal import marginal_covariances
from aatri.adjustment.iterative import preconditioner
from aatri.adjustment.iterative.conjugate_gradients import conjugate_gradients
from aatri.adjustment.iterative.forecast import Solver
from aatri.adjustment.records import Records
from aatri.adjustment.stepping.adjust import Step, adjust_large
from aatri.adjustment.stepping.adjusted import Adjusted
from aatri.adjustment.structure.index_problem import prepare
from aatri.errors import ConvergenceError, GeometryError, ResourceError, SpecError
from tests.adjustment.block_problem import _along, _group, joined_problem, made_problem, shared_problem
from tests.adjustment.test_solve import _many_fronts, _switched_off

MAKERS = {"plain": made_problem, "joined": joined_problem, "shared": shared_problem}
ROOM = {"none": 0.0, "some": 1.6, "all": 100.0}
"""Limit of the memory, in sizes of the factor; half of it is for subtrees."""


def _small_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    _many_fronts(monkeypatch)
    monkeypatch.setattr(preconditioner, "LEAST_PIECE", 12)
    monkeypatch.setattr(preconditioner, "MOST_PIECE", 12)


def _room_gb(unknowns, records, room: str) -> float:
    return ROOM[room] * prepare(unknowns, records).tree.factor_bytes / 1e9


def _both(maker: str, seed: int, room: str) -> tuple[Adjusted, Adjusted]:
    unknowns, records, start = MAKERS[maker](seed, n_kept=14, n_points=40)
    direct = adjust_large(unknowns, records, start, solver="direct")
    gb = _room_gb(unknowns, records, room)
    return direct, adjust_large(unknowns, records, start, solver="conjugate_gradients", memory_gb=gb)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("room", ROOM)
@pytest.mark.parametrize("maker", MAKERS)
@pytest.mark.parametrize("seed", range(2))
def test_the_direct_solution_to_a_millionth_of_its_standard_deviations(
    monkeypatch: pytest.MonkeyPatch, maker: str, room: str, seed: int
) -> None:
    _small_pieces(monkeypatch)
    direct, iterated = _both(maker, seed, room)
    nodes = len(direct.problem.tree.nodes)
    inside = sum(len(nodes) for nodes in iterated.problem.iterative.subtrees)
    assert {"none": inside == 0, "some": 0 < inside < nodes, "all": inside == nodes}[room]
    for name, covariance in marginal_covariances(direct).groups.items():
        sigma = np.sqrt(np.einsum("nii->ni", covariance))
        off = np.abs(iterated.state[name] - direct.state[name])
        assert (off <= 1e-6 * sigma).all()
    assert iterated.cost == pytest.approx(direct.cost, rel=1e-12)
    assert len(iterated.history) == len(direct.history)
    for a, b in zip(iterated.history, direct.history):
        assert a.decrement == pytest.approx(b.decrement, rel=1e-3)


@pytest.mark.slow
def test_damped_steps_are_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    _small_pieces(monkeypatch)
    unknowns, records, start = shared_problem(1, n_kept=14, n_points=40)
    gb = _room_gb(unknowns, records, "some")

    def history(solver: Solver) -> list[Step]:
        vetoes = iter(["too far", "still too far"])
        veto = lambda old, new: next(vetoes, "")  # noqa: E731
        return adjust_large(unknowns, records, start, solver=solver, memory_gb=gb, veto=veto).history

    expected, found = history("direct"), history("conjugate_gradients")
    assert max(s.damping for s in expected) > 0
    for key in ("damping", "cost", "decrement"):
        assert [getattr(s, key) for s in found] == pytest.approx([getattr(s, key) for s in expected], rel=1e-3)


@pytest.mark.slow
def test_the_same_bits_for_any_number_of_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    _small_pieces(monkeypatch)
    unknowns, records, start = joined_problem(2, n_kept=14, n_points=40)
    gb = _room_gb(unknowns, records, "some")
    first, *others = (
        adjust_large(unknowns, records, start, solver="conjugate_gradients", memory_gb=gb, threads=t)
        for t in (1, 1, 2, 3)
    )
    for other in others:
        assert (other.state["a"] == first.state["a"]).all()
        assert (other.state["p"] == first.state["p"]).all()


def test_covariances_are_refused_with_the_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    _small_pieces(monkeypatch)
    unknowns, records, start = made_problem(0, n_kept=14, n_points=40)
    result = adjust_large(unknowns, records, start, memory_gb=0.0)
    with pytest.raises(ResourceError, match="exact covariances need the factor"):
        marginal_covariances(result)
    with pytest.raises(ResourceError, match="exact covariances need the factor"):
        covariances_of_pairs(result, [(("a", 0), ("a", 1))])


@pytest.mark.parametrize("room", ROOM)
def test_an_open_unknown_is_named(monkeypatch: pytest.MonkeyPatch, room: str) -> None:
    _small_pieces(monkeypatch)
    monkeypatch.setattr("aatri.adjustment.openness.null_vectors.WHOLE", 0)
    unknowns, records, start = made_problem(3, n_kept=14, n_points=40)
    off = _switched_off(records, 0, 5)
    gb = _room_gb(unknowns, (off,), room)
    with pytest.raises(GeometryError, match="a5"):
        adjust_large(unknowns, (off,), start, solver="conjugate_gradients", memory_gb=gb)


def _chain_of_differences(n: int):
    """Differences of neighbours observed, nothing else."""
    here, there = np.arange(n - 1, dtype=np.int32), np.arange(1, n, dtype=np.int32)

    def evaluate(state, rows):
        one = np.broadcast_to(np.eye(2), (len(rows), 2, 2))
        return state["a"][there[rows]] - state["a"][here[rows]] - 1.0, (-one, one)

    whitener, active = np.ones((n - 1, 2)), np.ones(n - 1, dtype=bool)
    records = (Records("difference", (("a", here), ("a", there)), evaluate, whitener, active),)
    return (_group("a", np.ones((n, 2), bool), position=_along(n)),), records, {"a": np.zeros((n, 2))}


def test_a_common_shift_that_no_pivot_shows_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every piece is held by its neighbours, so that all their pivots are good; only the whole is open."""
    _small_pieces(monkeypatch)
    unknowns, records, start = _chain_of_differences(40)
    with pytest.raises(GeometryError, match=r"the observations leave unknowns open: .*of a a"):
        adjust_large(unknowns, records, start, solver="conjugate_gradients", memory_gb=0.0)


@pytest.mark.parametrize("sigma", [1.0, 1e3])
def test_a_shift_that_is_held_at_one_end_is_not_refused(monkeypatch: pytest.MonkeyPatch, sigma: float) -> None:
    _small_pieces(monkeypatch)
    unknowns, records, start = _chain_of_differences(40)
    end = Records(
        "end",
        (("a", np.array([0], dtype=np.int32)),),
        lambda state, rows: (state["a"][[0]][rows], (np.eye(2)[None][rows],)),
        np.full((1, 2), 1 / sigma),
        np.ones(1, bool),
    )
    result = adjust_large(unknowns, (*records, end), start, solver="conjugate_gradients", memory_gb=0.0)
    np.testing.assert_allclose(result.state["a"], np.repeat(np.arange(40.0)[:, None], 2, axis=1), atol=1e-6 * sigma)


def test_exact_constraints_ask_for_a_factor(monkeypatch: pytest.MonkeyPatch) -> None:
    unknowns, records, start = joined_problem()
    relation = records[-1]
    with pytest.raises(SpecError, match="exact constraints need a factor"):
        adjust_large(unknowns, records[:-1], start, constraints=[relation], solver="conjugate_gradients")
    with pytest.raises(ResourceError, match="exact constraints need a factor"):
        adjust_large(unknowns, records[:-1], start, constraints=[relation], memory_gb=0.0)


def test_the_error_is_within_its_bound() -> None:
    """Against a dense solve, for a matrix of known, widely spread eigenvalues."""
    rng = np.random.default_rng(0)
    Q, _ = np.linalg.qr(rng.normal(size=(200, 200)))
    S = Q * np.logspace(0, 4, 200) @ Q.T
    b = rng.normal(size=200)
    exact = np.linalg.solve(S, b)
    scale = np.diagonal(S)
    for accuracy in (1e-2, 1e-5, 1e-8):
        x = conjugate_gradients(lambda v: S @ v, b, lambda v: v / scale, accuracy)
        e = x - exact
        assert np.sqrt(e @ S @ e) <= 1.5 * accuracy * np.sqrt(exact @ S @ exact)


def test_what_does_not_converge_is_refused() -> None:
    S = np.diag([1.0, -1.0])
    with pytest.raises(ConvergenceError, match="conjugate gradients did not converge"):
        conjugate_gradients(lambda v: S @ v, np.array([0.1, 1.0]), lambda v: v, 1e-8)
