"""Residuals, derivatives and weights of all observation types, worked out by hand.

A camera of c = 150 mm looks down from (100, 200, 1000) m. The point (130, 160, 0) is u = (30, -40, -1000) m from it,
so that x = -150 * 30 / -1000 = 4.5 mm, y = -6 mm. Derivatives follow from x = -c u1/u3 and du = dX - dX0 - d x u.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.adjustment.records import (
    Records,
    active_lane,
    prepared_lane,
    whitened,
)
from aatri.camera.models import calibration
from aatri.observations.given_coordinates import value_records
from aatri.observations.image_point_rows import ImagePointRows, LinearCorrection
from aatri.observations.image_points import CameraRows, _of_rays, film_correction, image_point_records, side_veto
from aatri.observations.kernels.collinearity import in_front
from aatri.observations.object_space import object_space_records
from aatri.observations.poses import ADDITIONAL, CAMERA, FILM, POINT, POSE, Poses
from aatri.observations.positions import Positions, observed_positions

DOWN = np.eye(3)
QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
"""kappa = 90 degrees: the image's x axis points along Y."""
STATE = {
    POSE: Poses(
        np.array([[0.0, 0.0, 0.0], [100.0, 200.0, 1000.0], [100.0, 200.0, 1000.0]]), np.stack([DOWN, DOWN, QUARTER])
    ),
    POINT: np.array([[130.0, 160.0, 0.0], [0.0, 0.0, -1.0]]),
}
ROWS = ImagePointRows(
    image=np.array([1, 2], dtype=np.int32),
    point=np.array([0, 0], dtype=np.int32),
    xy_mm=np.array([[4.4, -5.9], [-6.1, -4.2]]),
    sigma_mm=np.array([[0.005, 0.01], [0.004, 0.02]]),
    c_mm=np.array([150.0, 150.0]),
    principal_point_mm=np.array([[0.5, -0.25], [0.1, 0.2]]),
    active=np.ones(2, dtype=bool),
)
V = np.array([[0.1, -0.1], [0.1, -0.3]])
"""Computed (4.5, -6) and, in the turned image, (-6, -4.5); minus measured."""
BY_POINT = np.array([[[0.15, 0.0, 0.0045], [0.0, 0.15, -0.006]], [[0.0, 0.15, -0.006], [-0.15, 0.0, -0.0045]]])


def cross_columns(by_point: np.ndarray, ray: np.ndarray) -> np.ndarray:
    """dv for turns about X, Y, Z: the ray turns back, d(ray) = ray x d, column by column."""
    turned = [np.cross(ray, axis) for axis in np.eye(3)]
    return np.stack([by_point @ change for change in turned], axis=-1)


def jacobians_of(records, state, rows):
    names = [name for name, _ in records.touches]
    v, J = records.evaluate(state, rows)
    return v, dict(zip(names, J))


def test_an_image_point_is_computed_minus_measured() -> None:
    records = image_point_records(ROWS)
    v, J = jacobians_of(records, STATE, np.arange(2))
    np.testing.assert_allclose(v, V, atol=1e-12)
    np.testing.assert_allclose(J[POINT], BY_POINT, atol=1e-12)
    np.testing.assert_allclose(J[POSE][:, :, :3], -BY_POINT, atol=1e-12)
    ray = np.array([30.0, -40.0, -1000.0])
    np.testing.assert_allclose(J[POSE][:, :, 3:], cross_columns(BY_POINT, ray), atol=1e-12)
    np.testing.assert_allclose(J[POSE][0, :, 5], [-6.0, -4.5], atol=1e-12)  # about the vertical: (u2, -u1) c / 1000


def test_chosen_rows_come_in_the_order_asked_for() -> None:
    records = image_point_records(ROWS)
    v, J = jacobians_of(records, STATE, np.array([1, 0, 1]))
    np.testing.assert_allclose(v, V[[1, 0, 1]], atol=1e-12)
    np.testing.assert_allclose(J[POINT], BY_POINT[[1, 0, 1]], atol=1e-12)


def test_image_points_are_weighted_by_their_own_standard_deviations() -> None:
    v, _ = whitened(image_point_records(ROWS), STATE, np.arange(2))
    np.testing.assert_allclose(v, [[20.0, -10.0], [25.0, -15.0]], rtol=1e-10)


def _lane(records: Records, order: np.ndarray):
    bind = prepared_lane(records, order)(records.whitener[order])
    return active_lane(bind, records.active[order], records.loss)


def test_a_rejected_image_point_has_no_weight_in_either_lane() -> None:
    records = image_point_records(replace(ROWS, active=np.array([True, False])))
    assert records.active.tolist() == [True, False]
    assert records.observations == 2
    v, J = whitened(records, STATE, np.arange(2))
    assert not v[1].any()
    assert not any(one[1].any() for one in J)
    assert records.compiled is not None
    fast, fast_J = np.full((2, 2), np.nan), (np.full((2, 2, 6), np.nan), np.full((2, 2, 3), np.nan))
    _lane(records, np.array([1, 0]))(STATE)(0, 2, fast, fast_J)
    np.testing.assert_allclose(fast, v[::-1], atol=1e-10)
    for fast_one, one in zip(fast_J, J):
        np.testing.assert_allclose(fast_one, one[::-1], atol=1e-9)


def test_the_film_correction_is_affine_in_photo_coordinates_and_added_to_the_measurement() -> None:
    d = np.zeros((3, 6))
    d[1], d[2] = [0.001, 1e-4, 2e-4, -0.002, 3e-4, -1e-4], [0.01, 0.0, 0.0, 0.02, 0.0, 0.0]
    records = image_point_records(ROWS, [film_correction(ROWS, FILM)])
    assert [name for name, _ in records.touches] == [POSE, FILM, POINT]
    v, J = jacobians_of(records, {**STATE, FILM: d}, np.arange(2))
    x, y = 4.9, -6.15  # from the fiducial centre
    first = [0.1 - (0.001 + 1e-4 * x + 2e-4 * y), -0.1 - (-0.002 + 3e-4 * x - 1e-4 * y)]
    np.testing.assert_allclose(v, [first, [0.1 - 0.01, -0.3 - 0.02]], atol=1e-12)
    np.testing.assert_allclose(J[FILM][0], [[-1, -x, -y, 0, 0, 0], [0, 0, 0, -1, -x, -y]], atol=1e-12)


@pytest.mark.parametrize("is_compiled", [False, True])
def test_each_correction_takes_the_block_of_its_own_ray(is_compiled: bool) -> None:
    basis = np.zeros((2, 2, 3))
    basis[0], basis[1] = [[1, 2, 3], [4, 5, 6]], [[1, 0, 0], [0, 1, 0]]
    additional = LinearCorrection(ADDITIONAL, np.array([1, 0]), basis)
    film = film_correction(ROWS, FILM)
    state = {
        **STATE,
        FILM: np.array([[0.0] * 6, [0.0] * 6, [0.5, 0, 0, 0, 0, 0]]),
        ADDITIONAL: np.array([[0.01, 0.02, 0.03], [0.1, 0.2, -0.3]]),
    }
    records = image_point_records(ROWS, [film, additional])
    assert [name for name, _ in records.touches] == [POSE, FILM, ADDITIONAL, POINT]
    expected = [[0.1 - (0.1 + 0.4 - 0.9), -0.1 - (0.4 + 1.0 - 1.8)], [0.1 - 0.5 - 0.01, -0.3 - 0.02]]
    if not is_compiled:
        v, J = jacobians_of(records, state, np.arange(2))
        np.testing.assert_allclose(v, expected, atol=1e-12)
        np.testing.assert_allclose(J[ADDITIONAL], -basis, atol=1e-12)
        return
    assert records.compiled is not None
    v, J = np.empty((2, 2)), tuple(np.empty((2, 2, k)) for k in (6, 6, 3, 3))
    _lane(records, np.array([1, 0]))(state)(0, 2, v, J)
    weights = 1.0 / ROWS.sigma_mm[::-1]
    np.testing.assert_allclose(v, np.array(expected)[::-1] * weights, atol=1e-9)
    np.testing.assert_allclose(J[2], -basis[::-1] * weights[:, :, None], atol=1e-9)


def test_part_of_the_rows_of_the_compiled_lane_is_filled_from_the_start_of_its_arrays() -> None:
    records = image_point_records(ROWS, [film_correction(ROWS, FILM)])
    assert records.compiled is not None
    v, J = np.empty((1, 2)), tuple(np.empty((1, 2, k)) for k in (6, 6, 3))
    _lane(records, np.array([0, 1]))({**STATE, FILM: np.zeros((3, 6))})(1, 2, v, J)
    np.testing.assert_allclose(v, [[25.0, -15.0]], rtol=1e-10)
    np.testing.assert_allclose(J[2][0], BY_POINT[1] / ROWS.sigma_mm[1][:, None], atol=1e-9)


def test_taken_rows_keep_all_their_columns_together() -> None:
    one = ROWS.take(np.array([1]))
    assert one.image.tolist() == [2]
    assert one.point.tolist() == [0]
    v, _ = image_point_records(one, [film_correction(ROWS, FILM).take(np.array([1]))]).evaluate(
        {**STATE, FILM: np.array([[0.0] * 6, [9.0] * 6, [0.01, 0, 0, 0, 0, 0]])}, np.arange(1)
    )
    np.testing.assert_allclose(v, [[0.09, -0.3]], atol=1e-12)
    assert one.sigma_mm.tolist() == [[0.004, 0.02]]
    assert one.principal_point_mm.tolist() == [[0.1, 0.2]]
    assert CameraRows(np.array([3, 4]), ("bal",) * 5).take(np.array([1])).block.tolist() == [4]


def test_rays_of_cameras_of_several_models_take_their_own() -> None:
    names = {model: calibration.PARAMETERS[model] for model in ("pinhole", "brown")}
    values = {
        "principal_distance": 160.0,
        "principal_point.x": 0.2,
        "principal_point.y": -0.1,
        "as": 0.01,
        "K1": 1e-5,
        "k1": 1e-5,
        "p1": 2e-5,
        "P1": 2e-5,
        "b1": 0.0,
        "B1": 0.0,
    }
    p = np.full((2, len(names["brown"])), np.nan)  # beyond a model's own size nothing is looked at
    p[1, :3] = [values[n] for n in names["pinhole"]]
    p[0] = [values.get(n, 0.0) for n in names["brown"]]
    cameras = CameraRows(np.array([1, 0]), ("brown", "pinhole"))
    records = image_point_records(ROWS, cameras=cameras)
    assert [name for name, _ in records.touches] == [POSE, CAMERA, POINT]
    assert records.compiled is not None
    v, J = jacobians_of(records, {**STATE, CAMERA: p}, np.arange(2))
    np.testing.assert_allclose(v[0], [4.8 + 0.2 - 4.4, -6.4 - 0.1 + 5.9], atol=1e-12)  # 160 * 0.03 and 160 * -0.04
    np.testing.assert_allclose(J[CAMERA][0, :, :3], [[0.03, 1, 0], [-0.04, 0, 1]], atol=1e-12)
    assert not J[CAMERA][0, :, 3:].any()
    x, y = 1.01 * (-6.1 - 0.2), -4.2 + 0.1
    r2 = x * x + y * y
    dx, dy = 1e-5 * x * r2 + 2e-5 * (r2 + 2 * x * x), 1e-5 * y * r2 + 2e-5 * 2 * x * y
    np.testing.assert_allclose(v[1], [-6.4 - (x + dx), -4.8 - (y + dy)], atol=1e-12)
    swapped, _ = jacobians_of(records, {**STATE, CAMERA: p}, np.array([1, 0]))
    np.testing.assert_allclose(swapped, v[::-1], atol=1e-15)


def test_the_veto_counts_active_points_that_change_sides_since_the_last_state_taken() -> None:
    above = {**STATE, POINT: np.array([[130.0, 160.0, 2000.0], [0.0, 0.0, -1.0]])}
    assert "2 image points" in side_veto(ROWS)(STATE, above)
    veto = side_veto(replace(ROWS, active=np.array([True, False])))
    assert "1 image point changes" in veto(STATE, above)
    assert veto(STATE, {**STATE}) == ""
    assert veto(above, {**above}) == ""  # what is behind from the start may stay there


def test_in_front_is_where_the_camera_looks() -> None:
    found = np.zeros(3, dtype=bool)
    image, point = np.array([1, 1, 2], dtype=np.int32), np.array([0, 1, 1], dtype=np.int32)
    X = np.array([[130.0, 160.0, 0.0], [100.0, 200.0, 2000.0]])
    in_front(0, 3, image, point, STATE[POSE].position_m, STATE[POSE].ground_from_image, X, found)
    assert found.tolist() == [True, False, False]  # down, towards -z of the camera; the second point is above it


def test_a_position_is_the_antenna_minus_the_observed_one() -> None:
    observed = np.array([[101.0, 205.0, 1002.0], [0.0, 0.0, 0.0]])
    covariance = np.stack([np.array([[4.0, 2.0, 0.0], [2.0, 9.0, 0.0], [0.0, 0.0, 0.25]]), np.eye(3)])
    arm = np.array([[2.0, 3.0, 0.5], [0.0, 0.0, 0.0]])
    rows = Positions(np.arange(2, dtype=np.int32), np.array([2, 0], dtype=np.int32), observed, covariance, arm)
    (found,) = observed_positions(rows, np.zeros(3), np.array(["c", "a"]))
    records = found.records
    v, (J,) = records.evaluate(STATE, np.arange(2))
    np.testing.assert_allclose(v, [[-1.0 - 3.0, -5.0 + 2.0, -2.0 + 0.5], [0.0, 0.0, 0.0]], atol=1e-12)
    turned = np.array([-3.0, 2.0, 0.5])  # the arm in ground axes; a turn d moves it by d x arm
    expected = np.stack([np.cross(axis, turned) for axis in np.eye(3)], axis=1)
    np.testing.assert_allclose(J[0], np.hstack([np.eye(3), expected]), atol=1e-12)
    np.testing.assert_allclose(J[1], np.hstack([np.eye(3), np.zeros((3, 3))]), atol=1e-12)
    white, _ = whitened(records, STATE, np.arange(2))
    vx, vy, vz = v[0]
    quadratic = (9 * vx**2 - 4 * vx * vy + 4 * vy**2) / 32 + vz**2 / 0.25  # v' inverse(covariance) v, by hand
    assert white[0] @ white[0] == pytest.approx(quadratic)
    assert records.observations == 6


def test_an_object_space_record_is_the_distance_from_the_ray_at_the_scale_of_the_image() -> None:
    rows = replace(ROWS, xy_mm=np.array([[4.5, -6.0], [-6.0, -4.5]]))
    on_ray = object_space_records(rows, 1000.0, 10.0)
    v, _ = on_ray.evaluate(STATE, np.arange(2))
    np.testing.assert_allclose(v, 0.0, atol=1e-12)
    records = object_space_records(ROWS, 500.0, 10.0)
    v, (by_pose, by_point) = records.evaluate(STATE, np.arange(2))
    # (c u1 + x u3) / D: (150 * 30 - 4.4 * 1000) / 500, and so on; in the turned image u = (-40, -30, -1000)
    np.testing.assert_allclose(v, [[0.2, -0.2], [0.2, -0.6]], atol=1e-12)
    np.testing.assert_allclose(by_point[0], [[0.3, 0, 0.0088], [0, 0.3, -0.0118]], atol=1e-12)
    np.testing.assert_allclose(by_point[1], [[0, 0.3, -0.0122], [-0.3, 0, -0.0084]], atol=1e-12)
    np.testing.assert_allclose(by_pose[:, :, :3], -by_point, atol=1e-12)
    ray = np.array([30.0, -40.0, -1000.0])
    np.testing.assert_allclose(by_pose[:, :, 3:], cross_columns(by_point, ray), atol=1e-10)
    white, _ = whitened(records, STATE, np.arange(2))
    np.testing.assert_allclose(white, v / (10.0 * ROWS.sigma_mm), rtol=1e-12)
    again, _ = records.evaluate(STATE, np.array([1]))
    np.testing.assert_allclose(again, [[0.2, -0.6]], atol=1e-12)


def test_a_rejected_ray_is_rejected_in_object_space_too() -> None:
    active = np.array([False, True])
    records = object_space_records(replace(ROWS, active=active), 500.0, 1.0)
    assert records.active.tolist() == [False, True]
    records.active[1] = False
    assert active.tolist() == [False, True]  # its own copy: the restart rejects nothing for the others


def test_observed_values_use_the_marginal_covariance_of_the_components_observed() -> None:
    covariance = np.array([[4.0, 99.0, 2.0], [99.0, 1e9, 99.0], [2.0, 99.0, 9.0]])
    observed = np.array([[True, False, True], [False, False, False]])
    value = np.array([[100.0, np.nan, -3.0], [np.nan, np.nan, np.nan]])
    records = value_records(
        "control",
        POINT,
        np.array([0, 1], dtype=np.int32),
        value,
        np.stack([covariance, np.full((3, 3), np.nan)]),
        observed,
    )
    assert records.active.tolist() == [True, False]
    assert records.observations == 2
    white, (J,) = whitened(records, STATE, np.arange(2))
    vx, vz = 30.0, 3.0
    assert white[0] @ white[0] == pytest.approx((9 * vx**2 - 4 * vx * vz + 4 * vz**2) / 32)
    assert not white[1].any()
    assert not J[0][:, 1].any()
    v, (J,) = records.evaluate(STATE, np.array([1, 0]))
    np.testing.assert_array_equal(v, [[0, 0, 0], [30, 0, 3]])
    np.testing.assert_array_equal(J[1], np.diag([1.0, 0, 1]))


def test_all_components_of_a_value_count_unless_it_is_said_otherwise() -> None:
    records = value_records("film", FILM, np.array([1]), np.array([[1.0, 2.0]]), np.diag([4.0, 16.0])[None])
    white, _ = whitened(records, {FILM: np.array([[0.0, 0.0], [3.0, 10.0]])}, np.arange(1))
    np.testing.assert_allclose(white, [[1.0, 2.0]])


def test_the_camera_of_one_ray_is_an_array_that_a_compiled_function_takes() -> None:
    """A view of one row is contiguous and not to be written to; one of more rows is no copy."""
    assert _of_rays(np.array([[152.0, 0.1]]), np.zeros(1, dtype=int)).flags.writeable
    assert _of_rays(np.array([[152.0, 0.1]]), np.zeros(3, dtype=int)).strides[0] == 0
