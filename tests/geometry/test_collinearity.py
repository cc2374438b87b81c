"""Collinearity: sign conventions and exact derivatives."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.geometry.collinearity import collinearity, in_image_axes, project
from aatri.geometry.rotations import rotation_from_angles, skew
from tests.complex_step import complex_step


def test_a_point_to_the_east_of_a_vertical_image_has_positive_x() -> None:
    # 1:1000 from 150 m: 10 m east is 10 mm, 20 m north is 20 mm
    u = in_image_axes(np.array([[0.0, 0.0, 150.0]]), np.eye(3)[None], np.array([[10.0, 20.0, 0.0]]))
    np.testing.assert_allclose(project(u, np.array([150.0])), [[10.0, 20.0]])


@pytest.mark.parametrize("seed", range(20))
def test_derivatives_equal_the_complex_step(seed: int) -> None:
    rng = np.random.default_rng(seed)
    R = rotation_from_angles(rng.uniform(-3, 3, 3))
    X0 = rng.normal(0, 100, 3)
    X = X0 + R @ np.array([rng.uniform(-50, 50), rng.uniform(-50, 50), -rng.uniform(50, 500)])

    def f(unknowns: np.ndarray) -> np.ndarray:
        # written out anew: small turn about the ground axes, then projection
        turn = np.eye(3) + skew(unknowns[3:6])
        u = (turn @ R).T @ (unknowns[6:] - unknowns[:3])
        return np.array([-153.84 * u[0] / u[2], -153.84 * u[1] / u[2]])

    expected = complex_step(f, np.concatenate([X0, np.zeros(3), X]))
    xy, by_pose, by_point = collinearity(X0[None], R[None], X[None], np.array([153.84]))
    scale = np.abs(expected).max(axis=0)
    np.testing.assert_allclose(np.hstack([by_pose[0], by_point[0]]) / scale, expected / scale, atol=1e-12)
    np.testing.assert_allclose(xy[0], f(np.concatenate([X0, np.zeros(3), X])).real, rtol=1e-13)
