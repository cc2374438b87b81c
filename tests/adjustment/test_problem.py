"""A problem as it is stated: residuals, loss, settings."""

from __future__ import annotations

import dataclasses
from dataclasses import replace

import numpy as np
import pytest

from aatri.adjustment import records as module
from aatri.adjustment.elimination.backsolve import cost_of
from aatri.adjustment.elimination.fronts import factorise
from aatri.adjustment.loss import NEWTON, Huber
from aatri.adjustment.problem import SolverSettings
from aatri.adjustment.records import Records, active_lane, excess, prepared_lane, whitened
from aatri.adjustment.stepping.adjust import adjust_large
from aatri.adjustment.structure.index_problem import prepare
from aatri.geometry.rotations import exp_rotation
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.image_points import film_correction, image_point_records
from aatri.observations.poses import FILM, POINT, POSE, Poses
from tests.adjustment.block_problem import joined_problem, made_problem, shared_problem
from tests.adjustment.reference import dense_jacobian, free_columns
from tests.complex_step import complex_step

# Residuals by the compiled lane are those of the NumPy form.


def test_residuals_of_film_with_open_corrections_are_the_same_by_either_way(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(3)
    n = 500
    rays = ImagePointRows(
        rng.integers(0, 4, n).astype(np.int32),
        rng.integers(0, 60, n).astype(np.int32),
        rng.normal(0, 50.0, (n, 2)),
        np.full((n, 2), 0.005),
        np.full(n, 150.0),
        np.zeros((n, 2)),
        rng.random(n) < 0.9,
    )
    records = image_point_records(rays, [film_correction(rays, FILM)])
    state = {
        POSE: Poses(rng.normal((0.0, 0.0, 1500.0), 100.0, (4, 3)), exp_rotation(rng.normal(0, 0.1, (4, 3)))),
        POINT: rng.normal(0, 300.0, (60, 3)) * [1, 1, 0.1],
        FILM: rng.normal(0, 1e-3, (4, 6)),
    }
    rows = rng.permutation(n)[:300]
    wanted = records.evaluate(state, rows)[0]
    monkeypatch.setattr(module, "CHUNK", 64)
    np.testing.assert_allclose(module.residuals(records, state, rows), wanted, rtol=1e-11, atol=1e-11)


# Huber's loss of whole records: gradient, matrix and cost against their definitions.

MAKERS = {"plain": made_problem, "joined": joined_problem, "shared": shared_problem}
K = 1.2


def _with_loss(records, loss: Huber):
    return tuple(replace(r, loss=loss) for r in records)


def _half_cost(unknowns, records, start, x):
    """Half the sum of rho over all active records, straight from the definition; x may be complex."""
    columns, total = free_columns(unknowns), 0.0
    padded = np.append(x, 0.0)
    state = {u.name: start[u.name] + padded[columns[u.name]] for u in unknowns}
    for r in records:
        v, _ = r.evaluate(state, np.arange(len(r.active)))
        v = np.einsum("nij,nj->ni", r.whitener, v)[r.active]
        s = np.sqrt((v * v).sum(axis=1))
        total = total + np.where(s.real > K, 2 * K * s - K**2, s**2).sum() / 2
    return total


@pytest.mark.parametrize("curvature", [0.0, 0.5, NEWTON])
@pytest.mark.parametrize("maker", MAKERS)
def test_the_gradient_is_that_of_half_the_robust_cost(maker: str, curvature: float) -> None:
    unknowns, records, start = MAKERS[maker]()
    n = sum(int(u.free.sum()) for u in unknowns)
    expected = complex_step(lambda x: np.array([_half_cost(unknowns, records, start, x)]), np.zeros(n))[0]
    J, v = dense_jacobian(unknowns, _with_loss(records, Huber(K, curvature)), start)
    np.testing.assert_allclose(J.T @ v, expected, rtol=1e-11, atol=1e-11 * np.abs(expected).max())


@pytest.mark.parametrize("curvature", [0.0, 0.5, NEWTON])
def test_the_matrix_bends_across_the_residual_only(curvature: float) -> None:
    rng = np.random.default_rng(5)
    v, J = 3 * rng.normal(size=(40, 2)), rng.normal(size=(40, 2, 5))
    s = np.linalg.norm(v, axis=1)
    n = v / s[:, None]
    far = s > K
    w = np.where(far, K / s, 1.0)[:, None, None]
    theta = np.where(far, curvature, 0.0)[:, None, None]
    expected = w * (J.swapaxes(1, 2) @ (np.eye(2) - theta * n[:, :, None] * n[:, None, :]) @ J)
    weighted, changed = v.copy(), J.copy()
    Huber(K, curvature).weigh(weighted, (changed,))
    np.testing.assert_allclose(changed.swapaxes(1, 2) @ changed, expected, rtol=1e-12, atol=1e-12)
    assert far.any()
    assert (changed[~far] == J[~far]).all()


@pytest.mark.parametrize("curvature", [0.0, NEWTON])
def test_the_cost_follows_from_the_weighted_residuals(curvature: float) -> None:
    v = np.random.default_rng(6).normal(size=(200, 3))
    s = np.linalg.norm(v, axis=1)
    loss = Huber(K, curvature)
    weighted = v.copy()
    loss.weigh(weighted, ())
    np.testing.assert_allclose(loss.costs(weighted), np.where(s > K, 2 * K * s - K**2, s**2), rtol=1e-11)
    np.testing.assert_array_equal(loss.beyond(weighted), s > K)
    _, records, _ = made_problem()
    rays = replace(records[0], loss=loss)
    expected = loss.costs(weighted).sum()
    assert (weighted**2).sum() + excess(rays, weighted) == pytest.approx(expected, rel=1e-10)


def _image_points(loss: Huber | None):
    rng = np.random.default_rng(8)
    n, images, points = 120, 4, 30
    image, point = (rng.integers(0, k, n).astype(np.int32) for k in (images, points))
    active = np.ones(n, dtype=bool)
    active[[3, 50]] = False
    state = {
        POSE: Poses(rng.normal(size=(images, 3), loc=(0, 0, 100.0)), exp_rotation(0.05 * rng.normal(size=(images, 3)))),
        POINT: 20 * rng.normal(size=(points, 3)),
    }
    nothing = ImagePointRows(
        image, point, np.zeros((n, 2)), np.full((n, 2), 0.01), np.full(n, 150.0), np.zeros((n, 2)), active
    )
    computed = image_point_records(nothing).residuals(state)
    noise = 0.01 * rng.normal(size=(n, 2)) * np.where(rng.random(n) < 0.2, 30.0, 1.0)[:, None]
    return replace(image_point_records(replace(nothing, xy_mm=computed + noise)), loss=loss), state


def _lane(records: Records, order: np.ndarray):
    bind = prepared_lane(records, order)(records.whitener[order])
    return active_lane(bind, records.active[order], records.loss)


@pytest.mark.parametrize("curvature", [0.0, NEWTON])
def test_both_lanes_of_image_points_are_equal(curvature: float) -> None:
    records, state = _image_points(Huber(1.5, curvature))
    assert records.compiled is not None
    order = np.random.default_rng(1).permutation(len(records.active))
    v, J = np.empty((len(order), 2)), (np.empty((len(order), 2, 6)), np.empty((len(order), 2, 3)))
    _lane(records, order)(state)(0, len(order), v, J)
    expected, jacobians = whitened(records, state, order)
    np.testing.assert_allclose(v, expected, rtol=1e-11, atol=1e-12)  # computed - measured loses a digit
    for found, wanted in zip(J, jacobians, strict=True):
        np.testing.assert_allclose(found, wanted, rtol=1e-11, atol=1e-11 * np.abs(wanted).max())
    slow = _lane(replace(records, compiled=None), order)(state)
    again = np.empty_like(v)
    slow(0, len(order), again, tuple(np.empty_like(j) for j in J))
    assert (again == expected).all()


def test_an_inactive_record_stays_zero() -> None:
    records, state = _image_points(Huber(1e-9))
    v, jacobians = whitened(records, state, np.arange(len(records.active)))
    off = ~records.active
    assert (v[off] == 0).all()
    assert all((J[off] == 0).all() for J in jacobians)
    assert not Huber(1e-9).beyond(v)[off].any()
    assert (np.abs(v[~off]).max(axis=1) > 0).all()


def test_sizes_of_records_for_messages_are_not_weighted() -> None:
    robust, state = _image_points(Huber(1.0))
    plain, _ = _image_points(None)
    np.testing.assert_allclose(robust.standardised(state), plain.standardised(state), rtol=1e-12)


@pytest.mark.parametrize(("k", "curvature"), [(0.0, 0.0), (-1.0, 0.0), (float("nan"), 0.0), (1.0, 1.0), (1.0, -0.1)])
def test_a_loss_that_is_none_is_refused(k: float, curvature: float) -> None:
    with pytest.raises(ValueError, match="Huber"):
        Huber(k, curvature)


@pytest.mark.parametrize("maker", MAKERS)
def test_the_cost_of_a_state_is_the_sum_of_the_loss_with_and_without_linearising(maker: str) -> None:
    unknowns, records, start = MAKERS[maker]()
    problem = prepare(unknowns, _with_loss(records, Huber(K, 0.5)))
    expected = 2 * _half_cost(unknowns, records, start, np.zeros(sum(int(u.free.sum()) for u in unknowns)))
    assert expected < sum(float((whitened(r, start, np.arange(len(r.active)))[0] ** 2).sum()) for r in records)
    assert cost_of(problem, start) == pytest.approx(expected, rel=1e-12)
    assert factorise(problem, start).cost == pytest.approx(expected, rel=1e-12)


# SolverSettings are given once, as one object or by name.


def test_settings_reach_the_problem_as_one_object_or_by_name() -> None:
    problem = made_problem()
    settings = SolverSettings(ordering="minimum_degree", threads=1, tolerance=1e-9)
    one = adjust_large(*problem, settings=settings)
    assert one.problem.settings == settings
    other = adjust_large(*problem, settings=SolverSettings(threads=1, tolerance=1e-9), ordering="minimum_degree")
    assert other.problem.settings == settings
    assert (one.state["a"] == other.state["a"]).all()


def test_an_unknown_setting_is_refused() -> None:
    with pytest.raises(TypeError, match="iterations"):
        adjust_large(*made_problem(), iterations=3)


def test_settings_cannot_be_changed() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        SolverSettings().threads = 2  # type: ignore[misc]
