"""The score test against the bordered normal equations, solved densely."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aatri.adjustment.covariance.score import moved, score
from aatri.adjustment.elimination import right_hand_sides
from aatri.adjustment.records import whitened
from aatri.adjustment.stepping.adjust import adjust_large
from aatri.adjustment.threads import thread_control
from tests.adjustment.block_problem import made_problem
from tests.adjustment.constraints.test_multipliers import conditions
from tests.adjustment.reference import dense_jacobian, free_columns


@pytest.mark.parametrize("of_the_problem", [True, False])
@pytest.mark.parametrize("seed", [1, 2])
def test_value_and_standard_deviation_are_those_of_an_adjustment_that_carries_the_parameter(
    seed: int, of_the_problem: bool
) -> None:
    unknowns, records, start = made_problem(seed, n_kept=8, n_points=20)
    result = adjust_large(unknowns, records, start)
    rays, rows = result.problem.records[0] if of_the_problem else records[0], np.arange(len(records[0].active))
    effect = np.random.default_rng(seed).normal(size=(len(rows), rays.rows, 2))
    found = score(result, rays, rows, effect)
    J, v = dense_jacobian(unknowns, records, result.state)
    H = np.where(rays.active[:, None, None], rays.whitener @ effect, 0.0).reshape(-1, 2)
    total = np.zeros((len(J), 2))
    total[: len(H)] = H
    assert np.allclose(v[: len(H)], whitened(rays, result.state, rows)[0].ravel())  # the rays come first
    columns = free_columns(unknowns)
    for k in range(2):
        A = np.column_stack([J, total[:, k]])
        Q = np.linalg.inv(A.T @ A)
        x = -Q @ A.T @ v
        one = found.joint(0, [k])
        assert one.value[0] == pytest.approx(x[-1], rel=1e-5)
        assert one.covariance[0, 0] == pytest.approx(Q[-1, -1], rel=1e-9)
        assert one.gain == pytest.approx(v @ v - ((v + A @ x) ** 2).sum(), rel=1e-5)
        assert found.seen[0, k] == pytest.approx(1 / (Q[-1, -1] * (total[:, k] @ total[:, k])), rel=1e-9)
        change = moved(result, rays, rows, effect[:, :, k])
        for group in ("a", "p"):
            expected = np.append(Q[:-1, -1] / Q[-1, -1], 0.0)[columns[group]]
            assert np.allclose(change[group], expected, atol=1e-9)
    A = np.column_stack([J, total])
    both = found.joint(0, [0, 1])
    assert both.rank == 2
    assert both.gain == pytest.approx(v @ v - ((v - A @ np.linalg.lstsq(A, v)[0]) ** 2).sum(), rel=1e-5)


def test_units_are_tested_each_with_the_others_at_zero() -> None:
    unknowns, records, start = made_problem(1, n_kept=8, n_points=20)
    result = adjust_large(unknowns, records, start)
    rays, rng = records[0], np.random.default_rng(1)
    rows = np.arange(len(rays.active))
    effect, unit = rng.normal(size=(len(rows), rays.rows, 3)), rng.permutation(len(rows)) % 40
    together = score(result, rays, rows, effect, unit)
    for k in (0, 17, 39):  # of three batches of right-hand sides
        some = np.flatnonzero(unit == k)
        alone = score(result, rays, rows[some], effect[some]).joint(0, [0, 2])
        found = together.joint(k, [0, 2])
        assert found.gain == pytest.approx(alone.gain, rel=1e-9)
        assert np.allclose(found.covariance, alone.covariance, rtol=1e-9)


def test_rays_that_belong_to_several_units_count_in_each(monkeypatch: pytest.MonkeyPatch) -> None:
    unknowns, records, start = made_problem(2, n_kept=8, n_points=20)
    result, rng = adjust_large(unknowns, records, start), np.random.default_rng(2)
    rows, unit = rng.integers(0, len(records[0].active), 90), np.sort(rng.integers(0, 12, 90))
    effect = rng.normal(size=(90, records[0].rows, 2))
    monkeypatch.setattr("aatri.adjustment.covariance.score.ROOM_BYTES", 2e3)  # a few units at a time
    found = score(result, result.problem.records[0], rows, effect, unit)
    reference = score(result, records[0], rows, effect, unit)
    assert np.allclose(found.information, reference.information, rtol=1e-9)
    assert np.allclose(found.gradient, reference.gradient, atol=1e-9)
    assert np.allclose(found.total, reference.total, rtol=1e-9)


def test_units_whose_gain_is_small_with_the_kept_unknowns_held_get_no_more_than_the_true_one() -> None:
    unknowns, records, start = made_problem(2, n_kept=8, n_points=20)
    result, rng = adjust_large(unknowns, records, start), np.random.default_rng(3)
    rays, rows = result.problem.records[0], np.arange(len(records[0].active))
    effect, unit = rng.normal(size=(len(rows), rays.rows, 2)), np.arange(len(rows)) % 10
    true = score(result, rays, rows, effect, unit).gains([0, 1])[0]
    bound = score(result, rays, rows, effect, unit, least_gain=np.inf).gains([0, 1])[0]
    assert (bound <= true + 1e-9).all()
    assert (bound < 0.999 * true).any()
    limit = float(np.median(bound))
    some = score(result, rays, rows, effect, unit, least_gain=limit).gains([0, 1])[0]
    assert np.allclose(some, np.where(bound >= limit, true, bound), rtol=1e-9)


def test_under_exact_constraints_the_information_of_units_is_that_of_the_dense_system(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    unknowns, records, start = made_problem(2, n_kept=14, n_points=40)
    constraints = conditions(unknowns)
    result = adjust_large(unknowns, records, start, constraints=constraints, tolerance=1e-9, threads=2)
    J, _ = dense_jacobian(unknowns, records, result.state)
    C = dense_jacobian(unknowns, constraints, result.state)[0]
    bordered = np.block([[J.T @ J, C.T], [C, np.zeros((len(C), len(C)))]])
    Q = np.linalg.pinv(bordered, hermitian=True)[: J.shape[1], : J.shape[1]]
    rays, rows, rng = records[0], np.arange(len(records[0].active)), np.random.default_rng(2)
    effect, unit = rng.normal(size=(len(rows), rays.rows, 2)), rng.permutation(len(rows)) % 12
    monkeypatch.setattr("aatri.adjustment.covariance.score.ROOM_BYTES", 1e4)  # a few units at a time
    threads = [one["num_threads"] for one in thread_control().info()]
    units = score(result, rays, rows, effect, unit)
    assert [one["num_threads"] for one in thread_control().info()] == threads
    for k in range(12):
        H = np.zeros((len(J), 2))
        H[: rays.rows * len(rows)] = np.where(
            (rays.active & (unit == k))[:, None, None], rays.whitener @ effect, 0.0
        ).reshape(-1, 2)
        assert np.allclose(units.information[k], H.T @ H - H.T @ J @ Q @ J.T @ H, rtol=1e-9, atol=1e-9)
    bound = score(result, rays, rows, effect, unit, least_gain=np.inf).gains([0, 1])[0]
    assert (bound <= units.gains([0, 1])[0] + 1e-9).all()


def test_what_the_unknowns_take_up_wholly_is_not_seen() -> None:
    unknowns, records, start = made_problem(3)
    result = adjust_large(unknowns, records, start)
    rays, rows = records[0], np.arange(len(records[0].active))
    of_point = rays.evaluate(result.state, rows)[1][-1]  # a shift of all points by one amount
    fitted = np.array(next(u.free for u in unknowns if u.name == "p"), dtype=np.float64)
    effect = np.einsum("nmk,nk->nm", of_point, fitted[rays.touches[-1][1]])[:, :, None]
    found = score(result, rays, rows, effect)
    assert found.seen[0, 0] == 0.0
    assert found.joint(0, [0]).rank == 0
    assert found.joint(0, [0]).gain == 0.0
    assert found.joint(0, [0]).value[0] == 0.0


def test_what_the_iteration_has_left_does_not_count_as_an_effect() -> None:
    unknowns, records, start = made_problem(1, n_kept=8, n_points=20)
    exact = adjust_large(unknowns, records, start)
    rays, rows, rng = records[0], np.arange(len(records[0].active)), np.random.default_rng(2)
    effect = rng.normal(size=(len(rows), rays.rows, 1))
    size = {u.name: u.free.shape for u in unknowns}
    away = {
        n: exact.state[n] + 1e-4 * rng.normal(size=size[n]) * next(u.free for u in unknowns if u.name == n)
        for n in ("a", "p")
    }
    early = replace(exact, state={**exact.state, **away}, factored=None)
    there, here = (score(one, rays, rows, effect).joint(0, [0]) for one in (exact, early))
    assert here.value[0] == pytest.approx(there.value[0], rel=1e-2)


def test_few_rays_at_a_time_are_linearised_for_what_all_of_them_give(monkeypatch: pytest.MonkeyPatch) -> None:
    unknowns, records, start = made_problem(3, n_kept=8, n_points=20)
    result = adjust_large(unknowns, records, start)
    rays, rows = result.problem.records[0], np.arange(len(records[0].active))
    effect = np.random.default_rng(3).normal(size=(len(rows), rays.rows))
    whole, linearised = moved(result, rays, rows, effect), list[int]()

    def counted(records: Any, state: Any, rows: Any) -> Any:
        linearised.append(len(rows))
        return whitened(records, state, rows)

    monkeypatch.setattr(right_hand_sides, "RAYS", 7)
    monkeypatch.setattr(right_hand_sides, "whitened", counted)
    for group, change in moved(result, rays, rows, effect).items():
        np.testing.assert_allclose(change, whole[group], rtol=1e-12, atol=1e-13)
    assert len(linearised) > 5
    assert max(linearised) < 7 + 3  # and the rays of one block more
