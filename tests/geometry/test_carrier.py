"""Roll, pitch, heading, mounts and rotation vectors, against SciPy and by hand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aatri.geometry.carrier import angle_axes, body_from_mount, exp_matrix, left_jacobian, log_vector

RNG = np.random.default_rng(4)
VECTORS = np.concatenate([RNG.normal(size=(50, 3)), 1e-5 * RNG.normal(size=(20, 3)), np.zeros((1, 3)),
                          np.pi * 0.999999 * np.eye(3), 3.0 * np.eye(3)])  # fmt: skip


def test_rotation_vectors_and_matrices_are_those_of_scipy() -> None:
    expected = Rotation.from_rotvec(VECTORS)
    np.testing.assert_allclose(exp_matrix(VECTORS), expected.as_matrix(), atol=1e-14)
    np.testing.assert_allclose(log_vector(expected.as_matrix()), expected.as_rotvec(), atol=1e-8)
    small = np.linalg.norm(VECTORS, axis=1) < 3
    np.testing.assert_allclose(log_vector(exp_matrix(VECTORS))[small], expected.as_rotvec()[small], atol=1e-14)


def test_the_left_jacobian_is_the_derivative_of_the_exponential_map() -> None:
    for w in VECTORS[:60]:
        columns = []
        for k in range(3):
            z = w.astype(complex)
            z[k] += 1e-200j
            turn = (exp_matrix(z[None])[0].imag / 1e-200) @ exp_matrix(w[None])[0].T
            columns.append([turn[2, 1], turn[0, 2], turn[1, 0]])
        np.testing.assert_allclose(left_jacobian(w[None])[0], np.array(columns).T, atol=1e-12)


@pytest.mark.parametrize(
    ("system", "order", "columns", "sign"),
    [("omega-phi-kappa", "XYZ", (0, 1, 2), (1, 1, 1)), ("phi-omega-kappa", "YXZ", (0, 1, 2), (-1, 1, 1)),
     ("roll-pitch-heading", "ZYX", (2, 1, 0), (1, 1, 1))],
)  # fmt: skip
def test_angles_turn_in_the_order_of_their_system(system: str, order: str, columns: tuple[int, ...],
                                                  sign: tuple[int, ...]) -> None:  # fmt: skip
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
