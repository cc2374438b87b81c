"""Problems in parts: the result is that of the whole, whatever is shared, held, joined, rejected or weighted down."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aatri.adjustment.covariance.marginal import marginal_covariances
from aatri.adjustment.loss import Huber
from aatri.adjustment.others import SharedEquations
from aatri.adjustment.parts import adjust as in_parts
from aatri.adjustment.parts.adjust import AdjustedInParts
from aatri.adjustment.parts.cut import cut
from aatri.adjustment.problem import SolverSettings
from aatri.adjustment.records import Records
from aatri.adjustment.stepping.adjust import adjust_large
from aatri.adjustment.structure.index_problem import prepare
from aatri.adjustment.unknowns import Unknowns, add_step
from aatri.adjustment.whitening import whitener_of_covariances
from aatri.errors import GeometryError
from aatri.progress import SILENT
from aatri.together import Threads
from tests.adjustment.block_problem import joined_problem, made_problem, posed_problem

SIZE = {"n_kept": 140, "n_points": 700, "rays": 4}
SETTINGS = SolverSettings(ordering="nested_dissection", tolerance=1e-8, reproducible=True)


def _with_camera() -> tuple[Any, Any, Any]:
    """A block that all rays touch, as a camera; it comes last in any order."""
    unknowns, records, start = posed_problem(3, **SIZE)
    ray, n = records[0], len(records[0].active)
    K = np.random.default_rng(5).normal(size=(n, 2, 2))
    camera = np.zeros(n, dtype=np.int32)

    def evaluate(state: Any, rows: Any) -> Any:
        v, (A, B) = ray.evaluate(state, rows)
        return v + K[rows] @ state["c"][0], (A, K[rows], B)

    touches = (ray.touches[0], ("c", camera), ray.touches[1])
    own = Unknowns("c", np.ones((1, 2), bool), ("k1", "k2"), ["lens"], add_step)
    return (
        (*unknowns, own),
        (replace(ray, touches=touches, evaluate=evaluate), *records[1:]),
        {
            **start,
            "c": np.zeros((1, 2)),
        },
    )


def _with_distances() -> tuple[Any, Any, Any]:
    """Observations between two points each, which are kept for their sake."""
    unknowns, records, start = posed_problem(4, **SIZE)
    here = np.arange(0, 600, 60, dtype=np.int32)
    there = here + 7

    def evaluate(state: Any, rows: Any) -> Any:
        between = state["p"][there[rows]] - state["p"][here[rows]]
        eye = np.broadcast_to(np.eye(3), (len(rows), 3, 3))
        return between - 0.2, (-eye, eye)

    whitener = whitener_of_covariances(np.tile(0.1 * np.eye(3), (len(here), 1, 1)))
    relation = Records("distance", (("p", here), ("p", there)), evaluate, whitener, np.ones(len(here), bool))
    return unknowns, (*records, relation), start


def _robust() -> tuple[Any, Any, Any]:
    unknowns, records, start = posed_problem(6, **SIZE)
    return unknowns, tuple(replace(r, loss=Huber(1.5)) for r in records), start


def _linear() -> tuple[Any, Any, Any]:
    unknowns, (_, prior), start = posed_problem(7, **SIZE)
    kept = np.arange(139, dtype=np.int32)
    A, B = np.random.default_rng(8).normal(size=(2, 139, 4, 6))

    def evaluate(state: Any, rows: Any) -> Any:
        a = state["a"]
        v = np.einsum("nij,nj->ni", A[rows], a[kept[rows]]) + np.einsum("nij,nj->ni", B[rows], a[kept[rows] + 1])
        return v - 1.0, (A[rows], B[rows])

    tie = Records("tie", (("a", kept), ("a", kept + 1)), evaluate, np.ones((139, 4)), np.ones(139, bool), linear=True)
    return unknowns[:1], (tie, replace(prior, linear=True)), {"a": start["a"]}


def _joint(problem: Any, parts: int, **settings: Any) -> Any:
    unknowns, records, start = problem
    return in_parts.adjust(
        unknowns,
        records,
        start,
        settings=replace(SETTINGS, parts=parts, **settings),
        vetoes=[None] * len(records),
        covariances=True,
    )


def _same(found: Any, whole: Any, covariances: Any) -> None:
    """Values to 1e-9 of their standard deviations, covariances to as much of theirs."""
    for name, C in covariances.groups.items():
        sigma = np.sqrt(np.maximum(np.einsum("nii->ni", C), 1e-30))
        assert (np.abs(found.state[name] - whole.state[name]) / sigma)[sigma > 1e-12].max() < 1e-9
        size = sigma[:, :, None] * sigma[:, None, :]
        np.testing.assert_allclose(found.covariances.groups[name] / size, C / size, atol=1e-9)
    for one, other in zip(found.covariances.records, covariances.records):
        np.testing.assert_allclose(one, other, atol=1e-9)


PROBLEMS: dict[str, Callable[[], Any]] = {
    "held scalars, blocks and an inactive record": lambda: made_problem(1, **SIZE),
    "joined groups, direct observations": lambda: joined_problem(2, **SIZE),
    "a camera that all share": _with_camera,
    "points kept for others' sake": _with_distances,
    "linear, nothing eliminated": _linear,
}


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("parts", [2, 5])
@pytest.mark.parametrize("name", PROBLEMS)
def test_parts_give_the_result_of_the_whole(name: str, parts: int) -> None:
    unknowns, records, start = problem = PROBLEMS[name]()
    whole = adjust_large(unknowns, records, start, settings=SETTINGS)
    found = _joint(problem, parts)
    assert isinstance(found, AdjustedInParts)
    assert not found.has_factor
    _same(found, whole, marginal_covariances(whole))
    assert (found.observations, found.n_unknowns, found.redundancy) == (
        whole.observations,
        whole.n_unknowns,
        whole.redundancy,
    )
    assert found.sigma0 == pytest.approx(whole.sigma0, rel=1e-12)


@pytest.mark.slow
def test_robust_weights_are_those_of_the_whole() -> None:
    unknowns, records, start = problem = _robust()
    whole, found = adjust_large(unknowns, records, start, settings=SETTINGS), _joint(problem, 3)
    assert isinstance(found, AdjustedInParts)
    assert found.down_weighted == whole.down_weighted > 0
    assert found.covariances is None
    for name, values in whole.state.items():
        np.testing.assert_allclose(found.state[name], values, atol=1e-8)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("refusals", [1, 3])
def test_a_step_that_one_part_refuses_is_damped_in_all(refusals: int) -> None:
    unknowns, records, start = made_problem(1, **SIZE)
    vetoes = iter(["too far"] * refusals)

    def veto(_rows: Any) -> Any:
        return lambda _old, _new: next(vetoes, "")

    found = in_parts.adjust(
        unknowns, records, start, settings=replace(SETTINGS, parts=2), vetoes=[veto, None], covariances=True
    )
    assert isinstance(found, AdjustedInParts)
    assert found.history[0].strayed
    whole = adjust_large(unknowns, records, start, settings=SETTINGS)
    _same(found, whole, marginal_covariances(whole))


@pytest.mark.slow
def test_the_bits_do_not_depend_on_who_comes_first() -> None:
    problem = made_problem(1, **SIZE)
    one, other = _joint(problem, 3), _joint(problem, 3, threads=2)
    for name, values in one.state.items():
        np.testing.assert_array_equal(other.state[name], values)
    for values, others in zip(one.covariances.records, other.covariances.records):
        np.testing.assert_array_equal(others, values)


def test_every_record_and_block_is_in_one_part() -> None:
    unknowns, records, _ = _with_camera()
    parts = cut(prepare(unknowns, records, ordering="nested_dissection"), 4)
    assert len(parts) == 4
    for k, r in enumerate(records):
        assert sorted(np.concatenate([p.rows[k] for p in parts])) == list(range(len(r.active)))
    for u in unknowns:
        assert (sum(p.own[u.name].astype(int) for p in parts) == 1).all()
    rays = [len(p.rows[0]) for p in parts]
    assert max(rays) < 1.5 * min(rays)


@pytest.mark.parametrize("shift", [0, 20, 70])
def test_a_part_has_every_block_that_its_records_touch_whichever_comes_first(shift: int) -> None:
    unknowns, records, _ = _with_camera()
    n = len(unknowns[0].free)

    def rolled(r: Records) -> Records:
        return replace(r, touches=tuple((g, (b + shift) % n if g == unknowns[0].name else b) for g, b in r.touches))

    first = unknowns[0]
    assert first.position is not None
    first = replace(first, free=np.roll(first.free, shift, 0), position=np.roll(first.position, shift, 0))
    unknowns, records = (first, *unknowns[1:]), tuple(map(rolled, records))
    stated = {u.name: u.free for u in unknowns}
    for p in cut(prepare(unknowns, records, ordering="nested_dissection"), 4):
        free = {u.name: u.free for u in p.unknowns}
        for r, rows in zip(records, p.rows):
            for group, block in r.touches:
                np.testing.assert_array_equal(free[group][block[rows]], stated[group][block[rows]])


def test_who_sends_parts_has_one_at_a_time_in_memory() -> None:
    class Sent(Threads):
        def together(self, work: Any, parts: Any, combine: Any) -> list[Any]:
            for k in range(len(parts)):
                part = parts[k]
                observations = weakref.ref(part.records[0])
                assert len(part.records[0].active) == len(part.part.rows[0])
                del part
                assert observations() is None
            return super().together(work, parts, combine)

    assert isinstance(_joint(posed_problem(1, **SIZE), 2, workers=Sent()), AdjustedInParts)


def test_where_the_whole_has_no_room_its_index_is_made_again_and_the_result_is_the_same(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    made = list[Any]()
    indexed = in_parts.indexed
    monkeypatch.setattr(in_parts, "indexed", lambda *stated: made.append(stated) or indexed(*stated))
    with_room = _joint(posed_problem(1, **SIZE), 2)
    assert len(made) == 1
    without = _joint(posed_problem(1, **SIZE), 2, memory_gb=1e-3)
    assert len(made) == 3
    assert isinstance(with_room, AdjustedInParts)
    assert isinstance(without, AdjustedInParts)
    assert without.problem.rays is not None
    np.testing.assert_array_equal(without.state["a"], with_room.state["a"])
    np.testing.assert_array_equal(without.covariances.groups["a"], with_room.covariances.groups["a"])


@pytest.mark.slow
def test_what_a_part_cannot_tell_is_told_of_the_whole() -> None:
    """A point that one ray is left of, and a block that nothing determines."""
    unknowns, (ray, prior), start = posed_problem(1, **SIZE)
    off = np.flatnonzero(ray.touches[1][1] == 70)[1:]
    open_ = [replace(ray, active=~np.isin(np.arange(len(ray.active)), off)), prior]
    said: list[str] = []

    class Told:
        log, warn, progress = said.append, said.append, SILENT.progress

    settings = replace(SETTINGS, parts=2)
    found = in_parts.adjust(
        unknowns, open_, start, settings=settings, vetoes=[None, None], reporter=Told(), covariances=True
    )
    whole = adjust_large(unknowns, open_, start, settings=SETTINGS)
    assert not isinstance(found, AdjustedInParts)
    assert any("adjusted as a whole" in line for line in said)
    np.testing.assert_array_equal(found.state["a"], whole.state["a"])
    assert [n.ids for n in found.notes] == [("p p70",)]
    own = ray.touches[0][1] == 70
    nothing = [replace(ray, active=~own), replace(prior, active=np.arange(140) != 70)]
    with pytest.raises(GeometryError, match="of a a70"):
        _joint((unknowns, nothing, start), 2)


def test_only_separators_travel() -> None:
    """n (n + 1) / 2 + 3 n numbers of n shared unknowns go up in an iteration, 2 n come down."""
    sent: list[tuple[int, int]] = []

    class Counted(Threads):
        def together(self, work: Any, parts: Any, combine: Any) -> list[Any]:
            def counted(messages: list[Any]) -> list[Any]:
                answers = combine(messages)
                for m, answer in zip(messages, answers):
                    if isinstance(m, SharedEquations):
                        n = len(m.number)
                        up = sum(a.nbytes for a in (m.number, m.N, m.g, m.diagonal))
                        assert up == 8 * (n * (n + 1) // 2 + 3 * n)
                        sent.append((n, answer.x.nbytes + answer.diagonal.nbytes))
                return answers

            return super().together(work, parts, counted)

    found = _joint(posed_problem(1, **SIZE), 2, workers=Counted())
    # an image meets the three before and after it on its points: the cut between halves is as wide
    assert {n for n, _ in sent} == {18}
    assert {down for _, down in sent} == {2 * 8 * 18}
    assert len(sent) == 2 * (len(found.history) + 1)  # linearised at the end for the covariances, too
