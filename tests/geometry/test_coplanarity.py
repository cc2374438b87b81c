"""Coplanarity: derivatives by complex step, intersection by closed forms and a published example."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from aatri.geometry.coplanarity import (
    RayPairs,
    coplanarity,
    coplanarity_derivatives,
    corrected,
    essential_derivatives,
    essential_matrix,
    parallax,
    sampson,
)
from aatri.geometry.intersection import intersect_pair, intersect_rays, projection_coefficients
from aatri.geometry.rotations import exp_rotation, rotation_from_angles
from aatri.geometry.vectors import tangents, unit
from tests.complex_step import complex_step


@pytest.fixture
def pair():
    rng = np.random.default_rng(4)
    left, right = (np.column_stack([rng.uniform(-100, 100, (9, 2)), np.full(9, -150.0)]) for _ in range(2))
    sigma = rng.uniform(0.003, 0.02, (2, 9, 2))
    return exp_rotation(rng.normal(size=3)), unit(rng.normal(size=3)), RayPairs(left, right, *sigma)


def _turned(d, R):
    """exp([d]x) R to first order: enough for a complex step."""
    x, y, z = d
    return R + np.array([[0 * x, -z, y], [z, 0 * x, -x], [-y, x, 0 * x]]) @ R


def _condition(b, R, left, right):
    """b . (u1 x R u2), written out."""
    w = right @ R.T
    return b @ np.cross(left, w).T


def _rays(coordinates):
    n = len(coordinates)
    z = np.full((n, 1), -150.0)
    return np.hstack([coordinates[:, :2], z]), np.hstack([coordinates[:, 2:], z])


def test_derivatives_by_the_unknowns_are_exact(pair) -> None:
    R, b, rays = pair
    T = tangents(b)
    numeric = complex_step(lambda p: _condition(b + T @ p[3:], _turned(p[:3], R), rays.left, rays.right), np.zeros(5))
    analytic, _ = coplanarity_derivatives(essential_derivatives(R, b, T), rays.left, rays.right)
    np.testing.assert_allclose(analytic, numeric, rtol=1e-12, atol=1e-10 * np.abs(numeric).max())


def test_derivatives_by_the_four_image_coordinates_are_exact(pair) -> None:
    R, b, rays = pair
    x = np.hstack([rays.left[:, :2], rays.right[:, :2]])
    numeric = complex_step(lambda c: _condition(b, R, *_rays(c)), x).reshape(9, 9, 4)
    F, gradient = coplanarity(essential_matrix(R, b), rays.left, rays.right)
    np.testing.assert_allclose(F, _condition(b, R, rays.left, rays.right), rtol=1e-12)
    np.testing.assert_allclose(gradient, numeric[range(9), range(9)], rtol=1e-10)


def test_derivatives_of_the_sampson_distance_hold_the_change_of_its_standard_deviation(pair):
    R, b, rays = pair
    T = tangents(b)
    variance = np.hstack([rays.left_sigma, rays.right_sigma]) ** 2

    def distance(p):
        turned, base = _turned(p[:3], R), b + T @ p[3:]
        of_left, of_right = np.cross(rays.right @ turned.T, base), np.cross(base, rays.left) @ turned
        s2 = (np.hstack([of_left[:, :2], of_right[:, :2]]) ** 2 * variance).sum(axis=1)
        return -_condition(base, turned, rays.left, rays.right) / np.sqrt(s2)

    v, J = sampson(R, b, T, rays)
    np.testing.assert_allclose(v, distance(np.zeros(5)), rtol=1e-12)
    numeric = complex_step(distance, np.zeros(5))
    np.testing.assert_allclose(J, numeric, rtol=1e-10, atol=1e-10 * np.abs(numeric).max())


def test_the_y_parallax_of_parallel_images_is_y2_minus_y1() -> None:
    xy = np.array([[10.0, 20.0, -80.0, 20.013], [5.0, -60.0, -85.0, -60.02]])
    sigma = np.full((2, 2), 0.005)
    p, s = parallax(np.eye(3), np.array([1.0, 0, 0]), RayPairs(*_rays(xy), sigma, sigma))
    np.testing.assert_allclose(p, [0.013, -0.02], rtol=1e-12)
    np.testing.assert_allclose(s, 0.005 * np.sqrt(2), rtol=1e-12)


def test_corrected_rays_are_coplanar_and_the_correction_is_the_smallest(pair) -> None:
    R, b, rays = pair
    X = np.random.default_rng(1).uniform(-1, 1, (9, 3)) - np.array([0, 0, 4.0])
    R = exp_rotation([0.1, -0.05, 0.3])
    left, right = (-150 * u / u[:, 2:] for u in (X, (X - b) @ R))
    left[:, :2] += np.random.default_rng(2).normal(0, 0.02, (9, 2))
    noisy = RayPairs(left, right, rays.left_sigma, rays.right_sigma)
    new_left, new_right = corrected(R, b, noisy)
    v, _ = sampson(R, b, tangents(b), noisy)
    left_over, _ = sampson(R, b, tangents(b), RayPairs(new_left, new_right, rays.left_sigma, rays.right_sigma))
    assert np.abs(left_over).max() < 1e-6
    moved = np.hstack([(new_left - left)[:, :2] / rays.left_sigma, (new_right - right)[:, :2] / rays.right_sigma])
    np.testing.assert_allclose(np.linalg.norm(moved, axis=1), np.abs(v), rtol=1e-3)


def test_projection_coefficients_are_those_of_the_textbook_where_the_rays_meet() -> None:
    # N1 = (Bx Z2 - Bz X2) / (X1 Z2 - X2 Z1), N2 = (Bx Z1 - Bz X1) / (X1 Z2 - X2 Z1)
    rng = np.random.default_rng(3)
    X, b = rng.uniform(-1, 1, (6, 3)) - np.array([0, 0, 4.0]), np.array([0.9, 0.1, -0.2])
    u1, w = X * rng.uniform(0.5, 2, (6, 1)), (X - b) * rng.uniform(0.5, 2, (6, 1))
    denominator = u1[:, 0] * w[:, 2] - w[:, 0] * u1[:, 2]
    expected = np.stack([(b[0] * w[:, 2] - b[2] * w[:, 0]), (b[0] * u1[:, 2] - b[2] * u1[:, 0])]) / denominator
    np.testing.assert_allclose(projection_coefficients(u1, w, b), expected.T, rtol=1e-12)


def test_intersection_covariance_is_that_of_repeated_measurement() -> None:
    rng = np.random.default_rng(5)
    b, R = np.array([1.0, 0, 0]), exp_rotation([0.02, -0.03, 0.05])
    X = np.array([[0.4, 0.7, -1.6]])
    left, right = (np.repeat(-150 * u / u[:, 2:], 4000, axis=0) for u in (X, (X - b) @ R))
    s1, s2 = np.full((4000, 2), 0.01), np.full((4000, 2), 0.02)
    left[:, :2] += rng.normal(0, s1)
    right[:, :2] += rng.normal(0, s2)
    found = intersect_pair(R, b, RayPairs(left, right, s1, s2))
    spread = np.cov(found.xyz.T)
    np.testing.assert_allclose(found.covariance[0], spread, rtol=0.1, atol=0.05 * spread.max())
    np.testing.assert_allclose(found.xyz.mean(axis=0), X[0], atol=1e-5)
    assert (found.depth > 0).all()


def test_parallel_rays_have_no_intersection() -> None:
    u, sigma = np.array([[1.0, 2.0, -150.0]]), np.full((1, 2), 0.01)
    found = intersect_pair(np.eye(3), np.array([1.0, 0, 0]), RayPairs(u, u, sigma, sigma))
    assert np.isnan(found.xyz).all()
    assert np.isnan(found.covariance).all()
    assert np.isnan(intersect_rays(np.eye(3)[:2], np.vstack([u, u]), np.array([0, 0]), 2)).all()


def test_many_rays_meet_in_their_points() -> None:
    rng = np.random.default_rng(6)
    points, centres = rng.uniform(-1, 1, (4, 3)), rng.uniform(-1, 1, (20, 3)) + np.array([0, 0, 500.0])
    row = np.arange(20) % 4
    found = intersect_rays(centres, (points[row] - centres) * rng.uniform(0.1, 9, (20, 1)), row, 5)
    np.testing.assert_allclose(found[:4], points, atol=1e-9)
    assert np.isnan(found[4]).all()


def test_intersection_engo431(shared_data: Path) -> None:
    text = (shared_data / "worked_examples" / "resection_intersection.yaml").read_text()
    example = next(e for e in yaml.safe_load(text) if e["id"] == "engo431_intersection")
    X1, X2 = (np.array(example[side]["X"]) for side in ("left_EO", "right_EO"))
    R1, R2 = (rotation_from_angles(np.radians(example[side]["opk_deg"])) for side in ("left_EO", "right_EO"))
    xy = np.array(list(example["obs"].values()))
    z, sigma = np.full((2, 1), -example["f_mm"]), np.full((2, 2), 0.01)
    rays = RayPairs(np.hstack([xy[:, :2], z]), np.hstack([xy[:, 2:], z]), sigma, sigma)
    found = intersect_pair(R1.T @ R2, R1.T @ (X2 - X1), rays).xyz @ R1.T + X1
    np.testing.assert_allclose(found, list(example["answer"].values()), atol=6e-4)
