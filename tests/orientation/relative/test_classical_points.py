"""Model coordinates by projection coefficients."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.geometry.coplanarity import RayPairs
from aatri.geometry.rotations import exp_rotation
from aatri.orientation.relative.classical_points import classical_points, connection_points


def pair(X: np.ndarray, R: np.ndarray, base: np.ndarray) -> RayPairs:
    """Image coordinates by plain projection, c = 150 mm."""
    second = (X - base) @ R
    left, right = (np.column_stack([-150.0 * p[:, :2] / p[:, 2:], np.full(len(p), -150.0)]) for p in (X, second))
    return RayPairs(left, right, np.full((len(X), 2), 0.005), np.full((len(X), 2), 0.005))


@pytest.mark.parametrize("mounted", [0.0, 0.5, 1.0, -0.5])
def test_error_free_rays_give_the_point_however_the_camera_is_mounted(mounted: float) -> None:
    rng = np.random.default_rng(1)
    c, s = np.cos(mounted * np.pi), np.sin(mounted * np.pi)
    turned = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    base = turned @ np.array([0.998, 0.05, -0.03])
    X = np.column_stack([rng.uniform(-0.2, 1.2, (30, 2)), rng.uniform(-1.8, -1.4, 30)]) @ turned.T
    R = exp_rotation(np.array([0.02, -0.03, 0.05]))
    assert classical_points(R, base, pair(X, R, base)) == pytest.approx(X, abs=1e-12)


def test_a_y_parallax_is_halved_and_leaves_x_and_z() -> None:
    """By hand: base (1, 0, 0), point (0.5, 0.2, -1.5), parallel images, y of the right image 0.2 mm too large."""
    X, base = np.array([[0.5, 0.2, -1.5]]), np.array([1.0, 0.0, 0.0])
    rays = pair(X, np.eye(3), base)
    rays.right[0, 1] += 0.2
    found = classical_points(np.eye(3), base, rays)[0]
    assert found == pytest.approx([0.5, 0.2 + 0.5 * 0.2 * 1.5 / 150.0, -1.5], abs=1e-12)


def test_a_connection_point_keeps_its_height_and_lies_on_the_right_ray() -> None:
    """By hand: base (1, 0, 0), parallel images; height -1.5 of the model before, x of the left image plays no part."""
    X, base = np.array([[0.5, 0.2, -1.5]]), np.array([1.0, 0.0, 0.0])
    rays = pair(X, np.eye(3), base)
    rays.left[0, :2] += 3.0
    assert connection_points(np.eye(3), base, rays, np.array([-1.5]))[0] == pytest.approx([0.5, 0.2, -1.5], abs=1e-12)
    lower = connection_points(np.eye(3), base, rays, np.array([-3.0]))[0]  # twice as far along the ray from (1, 0, 0)
    assert lower == pytest.approx([0.0, 0.4, -3.0], abs=1e-12)


def test_error_free_connection_points_of_tilted_images_come_back() -> None:
    rng = np.random.default_rng(2)
    X = np.column_stack([rng.uniform(0.2, 1.2, (30, 2)), rng.uniform(-1.8, -1.4, 30)])
    R, base = exp_rotation(np.array([0.02, -0.03, 0.05])), np.array([0.998, 0.05, -0.03])
    assert connection_points(R, base, pair(X, R, base), X[:, 2]) == pytest.approx(X, abs=1e-12)
