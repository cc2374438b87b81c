"""A linear problem solved once: solution, covariances and tests of one factor, against dense algebra."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.adjustment.covariance import solve as solving
from aatri.adjustment.covariance.marginal import marginal_covariances
from aatri.adjustment.covariance.solve import solve
from aatri.adjustment.elimination.reduced import reduced_normals
from aatri.adjustment.records import Records
from aatri.adjustment.stepping import adjusted
from aatri.adjustment.stepping.adjust import adjust_large
from aatri.adjustment.structure.index_problem import prepare
from aatri.adjustment.structure.indexed_problem import counts
from aatri.adjustment.structure.weights import Weights
from aatri.adjustment.unknowns import Unknowns, add_step
from aatri.adjustment.whitening import whitener_of_covariances, whitener_of_sigmas
from tests.adjustment.reference import dense_jacobian


def strips(seed: int = 0, *, n_strips: int = 6, n_points: int = 60):
    """Points in strips with 15 linear unknowns each, some points given: X = x + D c, whitened by full covariances."""
    rng = np.random.default_rng(seed)
    first = rng.integers(0, n_strips - 1, n_points)
    point = np.repeat(np.arange(n_points), 2).astype(np.int32)
    strip = (first[:, None] + np.arange(2)).ravel().astype(np.int32)
    t = rng.uniform(-1, 1, (len(point), 2))
    terms = np.stack([np.ones(len(t)), t[:, 0], t[:, 1], t[:, 0] ** 2, t[:, 0] * t[:, 1]], axis=1)
    D = np.zeros((len(t), 3, 15))
    for a in range(3):
        D[:, a, 5 * a : 5 * a + 5] = terms
    x = rng.normal(size=(len(t), 3))

    def tie(state, rows):
        v = state["point"][point[rows]] - x[rows] - np.einsum("nij,nj->ni", D[rows], state["strip"][strip[rows]])
        return v, (-D[rows], np.broadcast_to(np.eye(3), (len(rows), 3, 3)))

    half = rng.normal(size=(len(t), 3, 3))
    covariance = half @ half.swapaxes(1, 2) + 0.2 * np.eye(3)
    given = np.arange(0, n_points, 2, dtype=np.int32)
    xyz = rng.normal(size=(len(given), 3))
    sigma = np.full((len(given), 3), 0.5)
    sigma[::4, 2] = np.nan

    def control(state, rows):
        return state["point"][given[rows]] - xyz[rows], (np.broadcast_to(np.eye(3), (len(rows), 3, 3)),)

    records = (
        Records(
            "tie",
            (("strip", strip), ("point", point)),
            tie,
            whitener_of_covariances(covariance),
            np.ones(len(point), bool),
            linear=True,
        ),
        Records(
            "control", (("point", given),), control, whitener_of_sigmas(sigma), np.ones(len(given), bool), linear=True
        ),
    )
    unknowns = (
        Unknowns(
            "strip",
            np.ones((n_strips, 15), bool),
            tuple(f"c{i}" for i in range(15)),
            [f"s{i}" for i in range(n_strips)],
            add_step,
        ),
        Unknowns(
            "point",
            np.ones((n_points, 3), bool),
            ("X", "Y", "Z"),
            [f"p{i}" for i in range(n_points)],
            add_step,
            eliminated=True,
        ),
    )
    return unknowns, records, {"strip": np.zeros((n_strips, 15)), "point": np.zeros((n_points, 3))}


def _dense(unknowns, records, start):
    """Solution, whitened residuals and J Q J' of all records by the dense Jacobian of the active ones."""
    J, v = dense_jacobian(unknowns, records, start)
    every = [replace(r, active=np.ones_like(r.active)) for r in records]
    J_all, v_all = dense_jacobian(unknowns, every, start)
    Q = np.linalg.inv(J.T @ J)
    dx = -Q @ J.T @ v
    return dx, v_all + J_all @ dx, J_all @ Q @ J_all.T


def test_solution_covariances_and_tests_of_one_factor_equal_dense_algebra(monkeypatch: pytest.MonkeyPatch) -> None:
    unknowns, records, start = strips()
    index = prepare(unknowns, records)
    off = np.ones(len(records[0].active), bool)
    off[[3, 40]] = False
    count = []
    whole = solving.factorise_constrained
    monkeypatch.setattr(solving, "factorise_constrained", lambda *a: count.append(1) or whole(*a))
    monkeypatch.setattr(adjusted, "factorise_constrained", lambda *a: pytest.fail("factorised again"))
    solved = solve(index, start, {"tie": Weights(off)})
    used = (replace(records[0], active=off), records[1])
    dx, v, H = _dense(unknowns, used, start)
    np.testing.assert_allclose(solved.state["strip"].ravel(), dx[:90], atol=1e-9)
    np.testing.assert_allclose(solved.state["point"].ravel(), dx[90:], atol=1e-9)
    assert solved.departure < 1e-11
    tests = solved.tests()
    first = 0
    for r in used:
        found = tests[r.name]
        for k in range(len(r.active)):
            own = first + 3 * k + np.flatnonzero(r.observed_components()[k])
            here = np.flatnonzero(r.observed_components()[k])
            h = H[np.ix_(own, own)]
            R = np.eye(len(own)) - h if r.active[k] else np.eye(len(own)) + h
            np.testing.assert_allclose(found.redundancy[k][np.ix_(here, here)], R, atol=1e-9)
            e = v[own]
            np.testing.assert_allclose(found.whitened[k, here], e, atol=1e-9)
            P = np.linalg.pinv(np.where(np.abs(R) < 1e-9, 0.0, R), rcond=1e-6, hermitian=True)
            rank = int((np.linalg.eigvalsh(R) > 1e-6).sum())  # below: nothing controls, as of a point's last record
            wanted = np.sqrt(e @ P @ e / rank) if rank else np.nan
            assert found.test[k] == pytest.approx(wanted, rel=1e-6, nan_ok=True)
            np.testing.assert_allclose(found.size[k, here], -P @ e if r.active[k] else -e, rtol=1e-6, atol=1e-8)
        first += 3 * len(r.active)
    share = sum(np.trace(t.redundancy[k]) for t in tests.values() for k in np.flatnonzero(t.active))
    assert share == pytest.approx(counts(solved.problem)[2], rel=1e-9)
    assert len(count) == 1


@pytest.mark.parametrize("left", [0, 1])
def test_unknowns_that_are_all_held_but_one_leave_the_points_determined(left: int) -> None:
    unknowns, records, start = strips()
    free = np.zeros_like(unknowns[0].free)
    free[0, :left] = True
    held = (replace(unknowns[0], free=free), unknowns[1])
    solved = solve(prepare(held, records), start)
    J, v = dense_jacobian(unknowns, records, start)
    J = J[:, [*range(left), *range(90, J.shape[1])]]
    Q = np.linalg.inv(J.T @ J)
    dx = -Q @ J.T @ v
    np.testing.assert_allclose(solved.state["strip"][0, :left], dx[:left], atol=1e-9)
    np.testing.assert_allclose(solved.state["point"].ravel(), dx[left:], atol=1e-9)
    covariance = solved.covariances.groups["point"]
    np.testing.assert_allclose(np.einsum("nii->ni", covariance).ravel(), np.diag(Q)[left:], atol=1e-9)
    assert counts(solved.problem)[1] == len(dx)


def test_a_rejected_record_that_is_a_gross_error_shows_its_size_in_the_prediction() -> None:
    unknowns, records, start = strips(2)
    exact, whole = start, records[0].evaluate
    shift = np.zeros((len(records[0].active), 3))
    target = whole(exact, np.arange(len(shift)))[0]
    shift[7] = [5.0, 0.0, 0.0]

    def evaluate(state, rows):
        v, jacobians = whole(state, rows)
        return v - target[rows] - shift[rows], jacobians

    zero = records[1].evaluate(exact, np.arange(len(records[1].active)))[0]
    control = replace(
        records[1], evaluate=lambda s, r: (records[1].evaluate(s, r)[0] - zero[r], records[1].evaluate(s, r)[1])
    )
    active = records[0].active.copy()
    active[7] = False
    tie = replace(records[0], evaluate=evaluate, active=active)
    tests = solve(prepare(unknowns, (tie, control)), start).tests()["tie"]
    np.testing.assert_allclose(np.linalg.solve(tie.whitener[7], tests.size[7]), [5.0, 0.0, 0.0], atol=1e-8)
    assert np.nanmax(np.delete(tests.test, 7)) < 1e-7


def test_the_reduced_normals_are_those_of_dense_elimination() -> None:
    unknowns, records, start = strips(1)
    solved = solve(prepare(unknowns, records), start)
    J, _ = dense_jacobian(unknowns, records, start)
    A, E = J[:, :90], J[:, 90:]
    wanted = A.T @ (A - E @ np.linalg.lstsq(E, A, rcond=None)[0])
    np.testing.assert_allclose(reduced_normals(solved.problem, solved.state).N, wanted, atol=1e-9)


def test_a_linear_problem_is_factorised_once_by_the_iteration_too(monkeypatch: pytest.MonkeyPatch) -> None:
    unknowns, records, start = strips()
    result = adjust_large(unknowns, records, start)
    assert len(result.history) == 1
    expected = marginal_covariances(replace(result, factored=None))
    monkeypatch.setattr(adjusted, "factorise_constrained", lambda *a: pytest.fail("factorised again"))
    found = marginal_covariances(result)
    for group in start:
        np.testing.assert_allclose(found.groups[group], expected.groups[group], rtol=1e-10)
    dx, _, _ = _dense(unknowns, records, start)
    np.testing.assert_allclose(result.state["strip"].ravel(), dx[:90], atol=1e-9)


def test_a_record_without_redundancy_has_no_test_and_one_of_a_point_that_takes_no_part_neither() -> None:
    unknowns, records, start = strips()
    lonely = np.flatnonzero(records[0].touches[1][1] == 5)
    active = records[0].active.copy()
    active[lonely[0]] = False
    tests = solve(prepare(unknowns, records), start, {"tie": Weights(active)}).tests()["tie"]
    assert np.isnan(tests.test[lonely[1]])
    assert np.isfinite(tests.test[lonely[0]])
    active[lonely] = False
    tests = solve(prepare(unknowns, records), start, {"tie": Weights(active)}).tests()["tie"]
    assert np.isnan(tests.test[lonely]).all()
    assert np.isnan(tests.redundancy[lonely]).all()
