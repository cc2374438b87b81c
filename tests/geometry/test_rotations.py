"""Rotations, also compiled."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from aatri.geometry.kernels.rotations import turn
from aatri.geometry.rotations import (
    angle_axes,
    angle_covariance,
    angles_from_rotation,
    body_from_mount,
    exp_rotation,
    left_jacobian,
    levelling,
    log_rotation,
    nearest_rotation,
    rotation_from_angles,
    skew,
)

# Rotations: both angle systems, the exponential map, nearest rotation.

SYSTEMS = ("omega-phi-kappa", "phi-omega-kappa", "roll-pitch-heading")
angle = st.floats(-math.pi, math.pi)


def test_phi_omega_kappa_gives_the_printed_matrix_of_the_textbook_resection() -> None:
    # Wuhan University textbook example (c = 153.24 mm), matrix as printed by a program of the same convention
    printed = [[0.99771, 0.06753, 0.00399], [-0.06753, 0.99772, -0.00211], [-0.00412, 0.00184, 0.99999]]
    R = rotation_from_angles([-0.00399, 0.00211, -0.06758], "phi-omega-kappa")
    np.testing.assert_allclose(R, printed, atol=1e-5)


def test_omega_phi_kappa_is_the_product_of_the_elementary_turns() -> None:
    w, p, k = 0.3, -0.2, 1.1
    cw, sw, cp, sp, ck, sk = (f(a) for a in (w, p, k) for f in (math.cos, math.sin))
    expected = [
        [cp * ck, -cp * sk, sp],
        [cw * sk + sw * sp * ck, cw * ck - sw * sp * sk, -sw * cp],
        [sw * sk - cw * sp * ck, sw * ck + cw * sp * sk, cw * cp],
    ]
    np.testing.assert_allclose(rotation_from_angles([w, p, k]), expected, atol=1e-15)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("system", SYSTEMS)
@settings(max_examples=200, deadline=None)
@given(angle, st.floats(-1.5, 1.5), angle)
def test_angles_survive_the_round_trip(system: str, first: float, middle: float, third: float) -> None:
    R = rotation_from_angles([first, middle, third], system)
    returned = rotation_from_angles(angles_from_rotation(R, system), system)
    np.testing.assert_allclose(returned, R, atol=1e-13)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-15)


@pytest.mark.parametrize("system", SYSTEMS)
@pytest.mark.parametrize("middle", [math.pi / 2, -math.pi / 2])
def test_at_the_pole_the_matrix_still_returns(system: str, middle: float) -> None:
    R = rotation_from_angles([0.4, middle, -0.7], system)
    np.testing.assert_allclose(rotation_from_angles(angles_from_rotation(R, system), system), R, atol=1e-9)


@pytest.mark.parametrize("size", [0.0, 1e-12, 1e-6, 0.5, 3.0, math.pi - 1e-9])
def test_exponential_and_logarithm_are_inverse(size: float) -> None:
    d = size * np.array([2.0, -1.0, 2.0]) / 3.0
    R = exp_rotation(d)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-15)
    np.testing.assert_allclose(log_rotation(R), d, atol=1e-12 if size < 3 else 1e-7)


def test_exponential_is_the_power_series() -> None:
    K = skew(np.array([0.3, -0.1, 0.2]))
    series, term = np.eye(3), np.eye(3)
    for k in range(1, 25):
        term = term @ K / k
        series = series + term
    np.testing.assert_allclose(exp_rotation([0.3, -0.1, 0.2]), series, atol=1e-15)


def test_nearest_rotation_of_a_mirrored_matrix_is_no_mirror() -> None:
    R = nearest_rotation(np.diag([1.0, 1.0, -0.1]))
    assert np.linalg.det(R) == pytest.approx(1.0)


@pytest.mark.parametrize("system", SYSTEMS)
def test_angle_covariance_is_that_of_sampled_increments(system: str) -> None:
    rng = np.random.default_rng(3)
    R = rotation_from_angles([0.2, -0.4, 2.0], system)
    half = rng.normal(size=(3, 3))
    Q = 1e-8 * half @ half.T
    d = rng.multivariate_normal(np.zeros(3), Q, size=40_000)
    angles = angles_from_rotation(exp_rotation(d) @ R, system)
    # 40,000 samples: the standard error of a variance is 0.7 %
    expected = angle_covariance(R[None], Q[None], system)[0]
    sigma = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(np.cov(angles.T) / np.outer(sigma, sigma), expected / np.outer(sigma, sigma), atol=0.03)


@pytest.mark.parametrize(
    "up", [(0.0, 0.0, 2.0), (3.0, 0.0, 0.0), (0.3, -0.4, 0.5), (1e-3, 0.0, -1.0), (0.0, 0.0, -5.0)]
)
def test_levelling_turns_a_direction_to_z_by_the_angle_between_them(up: tuple[float, float, float]) -> None:
    R, u = levelling(np.array(up)), np.array(up) / np.linalg.norm(up)
    np.testing.assert_allclose(R @ u, [0.0, 0.0, 1.0], atol=1e-15)
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(R) == pytest.approx(1.0)
    assert np.trace(R) == pytest.approx(1.0 + 2.0 * u[2], abs=1e-12)


RNG = np.random.default_rng(4)
VECTORS = np.concatenate(
    [
        RNG.normal(size=(50, 3)),
        1e-5 * RNG.normal(size=(20, 3)),
        np.zeros((1, 3)),
        np.pi * 0.999999 * np.eye(3),
        3.0 * np.eye(3),
    ]
)


def test_rotation_vectors_and_matrices_are_those_of_scipy() -> None:
    expected = Rotation.from_rotvec(VECTORS)
    np.testing.assert_allclose(exp_rotation(VECTORS), expected.as_matrix(), atol=1e-14)
    np.testing.assert_allclose(log_rotation(expected.as_matrix()), expected.as_rotvec(), atol=1e-8)
    small = np.linalg.norm(VECTORS, axis=1) < 3
    np.testing.assert_allclose(log_rotation(exp_rotation(VECTORS))[small], expected.as_rotvec()[small], atol=1e-14)


def test_the_left_jacobian_is_the_derivative_of_the_exponential_map() -> None:
    for w in VECTORS[:60]:
        columns = []
        for k in range(3):
            z = w.astype(complex)
            z[k] += 1e-200j
            turn = (exp_rotation(z[None])[0].imag / 1e-200) @ exp_rotation(w[None])[0].T
            columns.append([turn[2, 1], turn[0, 2], turn[1, 0]])
        np.testing.assert_allclose(left_jacobian(w[None])[0], np.array(columns).T, atol=1e-12)


@pytest.mark.parametrize(
    ("system", "order", "columns", "sign"),
    [
        ("omega-phi-kappa", "XYZ", (0, 1, 2), (1, 1, 1)),
        ("phi-omega-kappa", "YXZ", (0, 1, 2), (-1, 1, 1)),
        ("roll-pitch-heading", "ZYX", (2, 1, 0), (1, 1, 1)),
    ],
)
def test_angles_turn_in_the_order_of_their_system(
    system: str, order: str, columns: tuple[int, ...], sign: tuple[int, ...]
) -> None:
    angles = RNG.uniform(-1, 1, (20, 3))
    R, G = angle_axes(angles, system)
    expected = Rotation.from_euler(order, angles[:, columns] * sign).as_matrix()
    np.testing.assert_allclose(R, expected, atol=1e-14)
    for k in range(3):
        step = np.zeros(3)
        step[k] = 1e-6
        ahead, back = (Rotation.from_euler(order, (angles + s)[:, columns] * sign) for s in (step, -step))
        np.testing.assert_allclose((ahead * back.inv()).as_rotvec() / 2e-6, G[:, :, k], atol=1e-8)


def test_the_camera_looks_down_and_its_x_axis_points_where_the_mount_says() -> None:
    """Body: x forward, y right, z down. Clockwise from above, 90 degrees from the nose is the right wing."""
    looking = np.array([0.0, 0.0, -1.0])
    for mount, x in ((0, [1, 0, 0]), (90, [0, 1, 0]), (180, [-1, 0, 0]), (270, [0, -1, 0])):
        M = body_from_mount(np.array([mount]))[0]
        np.testing.assert_allclose(M @ looking, [0, 0, 1], atol=1e-15)
        np.testing.assert_allclose(M[:, 0], x, atol=1e-15)
        assert np.linalg.det(M) == pytest.approx(1.0)


@pytest.mark.parametrize("size", [1e-6, 5e-4, 0.02, 0.5])
def test_the_left_jacobian_is_the_mean_of_the_rotations_on_the_way(size: float) -> None:
    """J = int_0^1 exp([s w]x) ds, by Gauss and Legendre's rule, on both sides of where a series takes over."""
    w = size * np.array([0.48, -0.6, 0.64])
    nodes, weights = np.polynomial.legendre.leggauss(12)
    mean = np.einsum("k,kij->ij", weights / 2, exp_rotation(0.5 * (nodes[:, None] + 1) * w))
    np.testing.assert_allclose(left_jacobian(w[None])[0], mean, atol=1e-14)


# The compiled exponential map against SciPy's.


@pytest.mark.parametrize("angle", [0.0, 1e-300, 1e-12, 1e-5, 0.3, 2.0, np.pi, 7.0])
def test_turning_a_matrix_is_multiplication_by_the_exponential(angle: float) -> None:
    rng = np.random.default_rng(3)
    axis = rng.normal(size=3)
    d = angle * axis / np.linalg.norm(axis)
    R = Rotation.from_rotvec(rng.normal(size=3)).as_matrix()
    turned = R.copy()
    turn(*d, turned)
    np.testing.assert_allclose(turned, Rotation.from_rotvec(d).as_matrix() @ R, atol=2e-15)
