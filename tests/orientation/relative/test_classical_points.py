"""Relative orientation from the classical six points, also compiled."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from aatri.geometry.coplanarity import RayPairs, corrected
from aatri.geometry.intersection import intersect_pair, projection_coefficients
from aatri.geometry.rotations import exp_rotation, skew
from aatri.geometry.vectors import tangents
from aatri.orientation.relative.connected_pairs import classical_points, connection_points
from aatri.orientation.relative.distance_derivatives import log_distances
from aatri.orientation.relative.kernels.model_points import PARALLEL, intersect
from tests.complex_step import complex_step
from tests.orientation.relative.pairs import rotation, simulate

# Model coordinates by projection coefficients.


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


# Intersection of model points, compiled: when rays are parallel.

SIGMA_MM = 0.005


def _intersected(left_mm: list[float], right_mm: list[float]) -> np.ndarray:
    """One point of two images that are not turned, the base along x."""
    pose = np.zeros((1, 3, 4))
    pose[0, :, :3], pose[0, :, 3] = np.eye(3), [1.0, 0.0, 0.0]
    rays = np.array([[*left_mm, *right_mm, *4 * [SIGMA_MM**2]]])
    model = np.full((1, 14), -1.0)
    intersect(0, 1, np.array([0, 1]), np.array([True]), pose, rays, model)
    return model[0]


@pytest.mark.parametrize(("share", "parallel"), [(0.8, True), (1.25, False)])
@pytest.mark.parametrize("c_right_mm", [150.0, 15.0, 1500.0])
def test_rays_are_parallel_below_the_bound_of_the_sine_whatever_their_lengths(
    share: float, parallel: bool, c_right_mm: float
) -> None:
    left, across = np.array([0.0, 60.0, -150.0]), np.array([-1.0, 0.0, 0.0])
    tangent = share * np.sqrt(PARALLEL) * np.linalg.norm(left)
    right = (left + tangent * across) * c_right_mm / 150.0
    assert np.isnan(_intersected(left.tolist(), right.tolist())[12]) == parallel


def test_the_point_lies_where_the_rays_meet() -> None:
    model = _intersected([40.0, 60.0, -150.0], [-4.0, 12.0, -30.0])
    depth = 150.0 / (40.0 + 20.0)  # of the base per mm of x-parallax at c = 150 mm
    np.testing.assert_allclose(model[:3], [40.0 * depth / 150.0, 60.0 * depth / 150.0, -depth], rtol=1e-13)
    np.testing.assert_allclose(model[12:14], [depth / 150.0, depth / 30.0], rtol=1e-13)


# Distances of model points and their derivatives by the orientation.


def noisy_pair(seed: int) -> Any:
    rng = np.random.default_rng(seed)
    X = np.column_stack([rng.uniform(-0.2, 0.9, 25), rng.uniform(-0.6, 0.6, 25), rng.uniform(-1.2, -0.8, 25)])
    turned = [rotation(rng) for _ in range(2)]
    rays, R, base = simulate(X, *turned, np.zeros(3), np.array([0.6, 0.05, -0.02]), rng)
    sigma = rng.uniform(0.5, 2.0, rays.left_sigma.shape)
    return RayPairs(rays.left, rays.right, sigma * rays.left_sigma, rays.right_sigma), R, base


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_derivatives_of_distances_equal_the_complex_step(seed: int) -> None:
    rays, R, base = noisy_pair(seed)
    T = tangents(base)

    def f(p: Any) -> Any:  # first-order retraction: the same derivative at zero
        turned, moved = (np.eye(3) + skew(p[:3])) @ R, base + T @ p[3:]
        of = RayPairs(rays.left.astype(complex), rays.right.astype(complex), rays.left_sigma, rays.right_sigma)
        left, right = corrected(turned, moved, of)
        w = right @ turned.T
        depth = projection_coefficients(left, w, moved)
        X = 0.5 * (depth[:, :1] * left + moved + depth[:, 1:] * w)
        return 0.5 * np.log((X * X).sum(axis=1))

    log_r, J = log_distances(R, base, rays)
    expected = complex_step(f, np.zeros(5))
    assert np.abs(J - expected).max() <= 1e-10 * np.abs(expected).max()
    assert log_r == pytest.approx(np.log(np.linalg.norm(intersect_pair(R, base, rays).xyz, axis=1)), abs=1e-14)
