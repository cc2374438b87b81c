"""Jacobians of all observation types against the complex step, written out anew."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.adjustment.records import predicted
from aatri.camera.models import calibration
from aatri.geometry.rotations import rotation_from_angles, skew
from aatri.observations.collinearity_lane import CameraRows, known_beforehand
from aatri.observations.given_coordinates import value_records
from aatri.observations.image_point_rows import ImagePointRows, LinearCorrection
from aatri.observations.image_points import film_correction, image_point_records, side_veto
from aatri.observations.poses import ADDITIONAL, CAMERA, FILM, POINT, POSE, Poses
from aatri.observations.positions import Positions, observed_positions
from tests.complex_step import complex_step


def _scaled(actual: np.ndarray, expected: np.ndarray) -> None:
    scale = np.maximum(np.abs(expected).max(axis=0), 1e-12)
    np.testing.assert_allclose(actual / scale, expected / scale, atol=1e-12)


def _ray(seed: int):
    rng = np.random.default_rng(seed)
    R = rotation_from_angles(rng.uniform(-3, 3, 3))
    X0 = rng.normal(0, 100, 3)
    X = X0 + R @ np.array([rng.uniform(-50, 50), rng.uniform(-50, 50), -rng.uniform(50, 500)])
    measured, pp = rng.uniform(-100, 100, 2), rng.normal(0, 0.02, 2)
    one = np.zeros(1, dtype=np.int32)
    rows = ImagePointRows(
        one, one, measured[None], np.full((1, 2), 0.005), np.array([153.84]), pp[None], np.ones(1, dtype=bool)
    )
    return rows, {POSE: Poses(X0[None], R[None]), POINT: X[None]}, R, X0, X, measured, pp, rng


@pytest.mark.parametrize("seed", range(10))
def test_image_points_with_film_and_additional_corrections(seed: int) -> None:
    rows, state, R, X0, X, measured, pp, rng = _ray(seed)
    d, a, K = rng.normal(0, 1e-3, 6), rng.normal(0, 1e-2, 4), rng.normal(size=(1, 2, 4))

    def f(z: np.ndarray) -> np.ndarray:
        u = ((np.eye(3) + skew(z[3:6])) @ R).T @ (z[6:9] - z[:3])
        x, y = measured + pp
        film = np.array([z[9] + z[10] * x + z[11] * y, z[12] + z[13] * x + z[14] * y])
        return -153.84 * u[:2] / u[2] - (measured + film + K[0] @ z[15:])

    z = np.concatenate([X0, np.zeros(3), X, d, a])
    additional = LinearCorrection(ADDITIONAL, np.zeros(1, dtype=np.int64), K)
    records = image_point_records(rows, [film_correction(rows, FILM), additional])
    v, J = records.evaluate({**state, FILM: d[None], ADDITIONAL: a[None]}, np.arange(1))
    _scaled(np.hstack([J[0][0], J[3][0], J[1][0], J[2][0]]), complex_step(f, z))
    np.testing.assert_allclose(v[0], f(z), atol=1e-11)


@pytest.mark.parametrize("model", sorted(calibration.PARAMETERS))
@pytest.mark.parametrize("seed", range(3))
def test_image_points_of_cameras_with_unknown_parameters(seed: int, model: str) -> None:
    rows, state, R, X0, X, measured, _, rng = _ray(seed)
    names = calibration.PARAMETERS[model]
    size = {"principal_distance": 153.84, "q": 1.0}
    p = np.array([size.get(n, 1e-3 * rng.normal() * (1e-6 if model == "brown" and n != "as" else 1.0)) for n in names])

    def f(z: np.ndarray) -> np.ndarray:
        u = ((np.eye(3) + skew(z[3:6])) @ R).T @ (z[6:9] - z[:3])
        return calibration.residual(model, u[None], measured[None].astype(z.dtype), z[None, 9:])[0]

    records = image_point_records(rows, cameras=CameraRows(np.zeros(1, dtype=np.int64), (model,)))
    _, (by_pose, by_camera, by_point) = records.evaluate({**state, CAMERA: p[None]}, np.arange(1))
    z = np.concatenate([X0, np.zeros(3), X, p])
    _scaled(np.hstack([by_pose[0], by_point[0], by_camera[0]]), complex_step(f, z))


def test_the_compiled_lane_equals_the_numpy_form() -> None:
    rng = np.random.default_rng(5)
    n = 40
    R = rotation_from_angles(rng.normal(0, 0.1, (4, 3)))
    X0 = np.array([0.0, 0.0, 400.0]) + rng.normal(0, 50, (4, 3))
    X = rng.uniform(-200, 200, (12, 3)) * [1, 1, 0.1]
    rows = ImagePointRows(
        rng.integers(0, 4, n),
        rng.integers(0, 12, n),
        rng.uniform(-100, 100, (n, 2)),
        rng.uniform(0.004, 0.01, (n, 2)),
        rng.choice([150.0, 153.0], n),
        np.zeros((n, 2)),
        rng.uniform(size=n) > 0.2,
    )
    state = {POSE: Poses(X0, R), POINT: X, FILM: rng.normal(0, 1e-3, (4, 6))}
    records = image_point_records(rows, [film_correction(rows, FILM)])
    assert records.compiled is not None
    order = rng.permutation(n)
    v, J = np.empty((25, 2)), tuple(np.empty((25, 2, k)) for k in (6, 6, 3))
    records.compiled(order)(records.whitener[order])(state)(10, 35, v, J)
    expected, jacobians = predicted(records, state, order[10:35])
    np.testing.assert_allclose(v, expected, rtol=1e-12, atol=1e-9)
    for found, wanted in zip(J, jacobians):
        np.testing.assert_allclose(found, wanted, rtol=1e-12, atol=1e-9)


def _many_rays(seed: int) -> tuple[ImagePointRows, dict[str, object], np.random.Generator]:
    rng, n = np.random.default_rng(seed), 40
    X0 = np.array([0.0, 0.0, 400.0]) + rng.normal(0, 50, (4, 3))
    X = rng.uniform(-200, 200, (12, 3)) * [1, 1, 0.1]
    rows = ImagePointRows(
        rng.integers(0, 4, n),
        rng.integers(0, 12, n),
        rng.uniform(-100, 100, (n, 2)),
        rng.uniform(0.004, 0.01, (n, 2)),
        np.full(n, 150.0),
        np.zeros((n, 2)),
        rng.uniform(size=n) > 0.2,
    )
    return rows, {POSE: Poses(X0, rotation_from_angles(rng.normal(0, 0.1, (4, 3)))), POINT: X}, rng


def _models(names: tuple[str, ...], rng: np.random.Generator) -> np.ndarray:
    p = np.zeros((len(names), max(len(calibration.PARAMETERS[m]) for m in names)))
    for row, model in zip(p, names):
        for k, name in enumerate(calibration.PARAMETERS[model]):
            size = {"principal_distance": 150.0, "q": 1.0}.get(name, 0.0)
            row[k] = size + rng.normal() * (1e-6 if model == "brown" and name != "as" else 1e-3)
    return p


@pytest.mark.parametrize("known", [False, True])
@pytest.mark.parametrize(
    "models", [("brown", "brown"), ("opencv", "opencv"), ("fisheye", "brown"), ("bal", "bal"), ("bal", "pinhole")]
)
def test_the_compiled_lane_of_camera_models_equals_the_numpy_form(models: tuple[str, ...], known: bool) -> None:
    rows, state, rng = _many_rays(7)
    p = _models(models, rng)
    block = rng.integers(0, 2, 40)
    K = LinearCorrection(ADDITIONAL, rng.integers(0, 3, 40), rng.normal(size=(40, 2, 5)))
    state = {**state, CAMERA: p, ADDITIONAL: rng.normal(0, 1e-2, (3, 5))}
    records = image_point_records(rows, [K], CameraRows(block, models, p if known else None))
    assert records.compiled is not None
    order = rng.permutation(40)
    widths = (6, 5, 3) if known else (6, 5, p.shape[1], 3)
    v, J = np.empty((25, 2)), tuple(np.full((25, 2, k), np.nan) for k in widths)
    records.compiled(order)(records.whitener[order])(state)(10, 35, v, J)
    expected, jacobians = predicted(records, state, order[10:35])
    np.testing.assert_allclose(v, expected, rtol=1e-12, atol=1e-9)
    for found, wanted in zip(J, jacobians, strict=True):
        np.testing.assert_allclose(found, wanted, rtol=1e-11, atol=1e-12 * np.abs(wanted).max())


def test_known_models_that_correct_the_measurement_leave_a_central_projection() -> None:
    rows, state, rng = _many_rays(8)
    p, block = _models(("brown", "pinhole"), rng), rng.integers(0, 2, 40)
    known = CameraRows(block, ("brown", "pinhole"), p)
    corrected, left = known_beforehand(rows, known)
    assert left is None
    some = np.arange(40)
    v, J = image_point_records(rows, cameras=known).evaluate(state, some)
    found, jacobians = image_point_records(corrected).evaluate(state, some)
    np.testing.assert_allclose(found, v, atol=1e-12)
    for a, b in zip(jacobians, J, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_positions_with_a_lever_arm(seed: int) -> None:
    rng = np.random.default_rng(seed)
    R, X0, arm, observed = rotation_from_angles(rng.uniform(-3, 3, 3)), *rng.normal(0, 2, (3, 3))
    first = np.zeros(1, np.int32)
    rows = Positions(first, first, observed[None], np.eye(3)[None], arm[None])
    (found,) = observed_positions(rows, np.zeros(3), np.array(["a"]))
    records = found.records

    def f(z: np.ndarray) -> np.ndarray:
        return z[:3] + (np.eye(3) + skew(z[3:])) @ R @ arm - observed

    v, (by_pose,) = records.evaluate({POSE: Poses(X0[None], R[None])}, np.arange(1))
    z = np.concatenate([X0, np.zeros(3)])
    _scaled(by_pose[0], complex_step(f, z))
    np.testing.assert_allclose(v[0], f(z), atol=1e-12)


def test_only_observed_components_of_a_value_count() -> None:
    observed = np.array([[True, False, True]])
    records = value_records(
        "control",
        POINT,
        np.zeros(1, np.int32),
        np.array([[1.0, np.nan, 3.0]]),
        np.diag([4.0, np.nan, 9.0])[None],
        observed,
    )
    v, (J,) = records.evaluate({POINT: np.array([[3.0, 5.0, 9.0]])}, np.arange(1))
    np.testing.assert_allclose(np.einsum("nij,nj->ni", records.whitener, v), [[1.0, 0.0, 2.0]])
    assert records.observations == 2
    np.testing.assert_allclose(J[0], np.diag([1.0, 0.0, 1.0]))


def test_a_point_that_passes_through_the_camera_is_seen() -> None:
    rows, state, _, X0, X, *_ = _ray(0)
    behind = {**state, POINT: (2 * X0 - X)[None]}
    veto = side_veto(rows)
    assert "1 image point changes" in veto(state, behind)
    assert veto(state, state) == ""
    assert "1 image point changes" in veto(behind, state)
