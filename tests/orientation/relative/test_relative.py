"""Dependent relative orientation."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aatri.errors import GeometryError
from aatri.geometry.coplanarity import RayPairs

sys.path.insert(0, str(Path(__file__).parent))
from tests.orientation.relative.pairs import gruber_ground, rays_of, relative_orientation, rotation, simulate

B = np.array([0.6, 0.02, -0.01])
ORIGIN = np.zeros(3)


@pytest.mark.parametrize("kappa_right", [0.0, np.pi / 2, np.pi, -2.5])
@pytest.mark.parametrize("kappa_left", [0.0, np.pi])
def test_error_free_pairs_are_recovered_to_machine_precision(kappa_left, kappa_right) -> None:
    rng = np.random.default_rng(5)
    X = gruber_ground(3, rng, relief=0.1)
    rays, R, b = simulate(X, rotation(rng, kappa=kappa_left), rotation(rng, kappa=kappa_right), ORIGIN, B)
    found = relative_orientation(rays)
    np.testing.assert_allclose(found.left_from_right, R, atol=1e-12)
    np.testing.assert_allclose(found.base, b, atol=1e-12)
    assert found.active.all()
    assert found.sigma0 < 1e-8


def test_oblique_and_convergent_pairs_of_any_direction_are_recovered() -> None:
    for seed in range(12):
        rng = np.random.default_rng(seed)
        X = rng.uniform(-1, 1, (15, 3))
        stations = [rng.normal(size=3) for _ in range(2)]
        stations = [4 * s / np.linalg.norm(s) for s in stations]
        if np.linalg.norm(np.cross(*stations)) < 2:
            continue
        R1, R2 = (_looking_at_origin(s, rng) for s in stations)
        rays, R, b = simulate(X, R1, R2, *stations)
        found = relative_orientation(rays)
        np.testing.assert_allclose(found.left_from_right, R, atol=1e-11)
        np.testing.assert_allclose(found.base, b, atol=1e-11)


def _looking_at_origin(station, rng: np.random.Generator):
    z = station / np.linalg.norm(station)
    x = np.cross(rng.normal(size=3), z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def test_redundancy_numbers_of_the_six_gruber_points() -> None:
    # reference C.7: (1/3, 1/3, 1/12 x 4), the normal case with the middle points first
    places = np.array([[x, y, -1.0] for x in (0.0, 0.6) for y in (0.0, 0.6, -0.6)])
    rays, _, _ = simulate(places, np.eye(3), np.eye(3), ORIGIN, np.array([0.6, 0, 0]))
    found = relative_orientation(rays)
    r = (found.error_sigma_mm / (0.005 * np.sqrt(2))) ** -2
    assert found.redundancy == 1
    np.testing.assert_allclose(r, np.array([4, 1, 1, 4, 1, 1]) / 12, atol=1e-9)


def test_sigma0_is_one_and_the_covariance_is_that_of_repetitions() -> None:
    rng = np.random.default_rng(2)
    X = gruber_ground(3, rng, relief=0.05)
    R1, R2 = rotation(rng), rotation(rng)
    d, s = [], []
    for _ in range(100):
        rays, R, _ = simulate(X, R1, R2, ORIGIN, B, rng)
        found = relative_orientation(rays, snooping_limit=6.0)
        d.append(Rotation.from_matrix(found.left_from_right @ R.T).as_rotvec())
        s.append(found.sigma0**2)
    assert np.mean(s) == pytest.approx(1.0, abs=4 * np.sqrt(2 / 13 / 100))
    np.testing.assert_allclose(np.std(d, axis=0), np.sqrt(np.diag(found.covariance)[:3]), rtol=0.25)


def test_gross_errors_are_rejected_with_their_size() -> None:
    rng = np.random.default_rng(4)
    X = gruber_ground(4, rng, relief=0.05)
    rays, R, _ = simulate(X, rotation(rng), rotation(rng), ORIGIN, B, rng)
    right = rays.right.copy()
    right[3, 1] += 0.1
    right[17, 1] -= 5.0
    found = relative_orientation(RayPairs(rays.left, right, rays.left_sigma, rays.right_sigma))
    assert np.flatnonzero(~found.active).tolist() == [3, 17]
    assert abs(found.error_mm[3] - 0.1) < 4 * found.error_sigma_mm[3]
    assert abs(found.error_mm[17] + 5.0) < 0.05
    np.testing.assert_allclose(found.left_from_right, R, atol=2e-4)


def test_forty_percent_mismatches_are_survived() -> None:
    rng = np.random.default_rng(6)
    X = gruber_ground(8, rng, relief=0.05)
    rays, R, _ = simulate(X, rotation(rng), rotation(rng, kappa=1.0), ORIGIN, B, rng)
    right = rays.right.copy()
    wrong = np.arange(0, 48, 5).tolist() + np.arange(1, 48, 5).tolist()
    right[wrong, :2] = rng.uniform(-100, 100, (len(wrong), 2))
    found = relative_orientation(RayPairs(rays.left, right, rays.left_sigma, rays.right_sigma))
    np.testing.assert_allclose(found.left_from_right, R, atol=5e-4)
    assert (~found.active)[wrong].sum() >= len(wrong) - 1


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda X, rng: simulate(X[:4], np.eye(3), np.eye(3), ORIGIN, B)[0], "4 common points"),
        (lambda X, rng: simulate(X * [1, 0, 1], np.eye(3), np.eye(3), ORIGIN, B)[0], "on a line"),
        (lambda X, rng: simulate(X, np.eye(3), rotation(rng), ORIGIN, 1e-9 * B, rng)[0], "no base"),
        (lambda X, rng: rays_of(100 * X[:, :2], 100 * X[:, :2]), "identical coordinates"),
        (lambda X, rng: rays_of(rng.uniform(-90, 90, (18, 2)), rng.uniform(-90, 90, (18, 2))), "one orientation"),
        (
            lambda X, rng: simulate(_cylinder(rng), np.eye(3), np.eye(3), ORIGIN, np.array([0.6, 0, 0]))[0],
            "critical cylinder",
        ),
    ],
)
def test_unfavourable_geometry_is_refused_with_the_reason(make, reason: str) -> None:
    rng = np.random.default_rng(1)
    with pytest.raises(GeometryError, match=reason):
        relative_orientation(make(gruber_ground(3, rng, relief=0.05), rng))


def _cylinder(rng: np.random.Generator):
    """Points on a circular cylinder through both projection centres, its axis along the base."""
    angle = rng.uniform(-1, 1, 18)
    return np.column_stack([rng.uniform(0, 0.6, 18), np.sin(2 * angle) * 0.5, -0.5 - 0.5 * np.cos(2 * angle)])


def test_exactly_five_points_are_oriented_with_a_warning() -> None:
    rng = np.random.default_rng(11)
    rays, R, b = simulate(gruber_ground(2, rng, relief=0.1)[:9:2], rotation(rng), rotation(rng), ORIGIN, B)
    found = relative_orientation(rays)
    np.testing.assert_allclose(found.left_from_right, R, atol=1e-9)
    np.testing.assert_allclose(found.base, b, atol=1e-9)
    assert found.redundancy == 0
    assert np.isnan(found.sigma0)
    assert "no redundancy" in found.warnings[0]


def test_an_error_among_six_points_is_seen_but_no_point_is_blamed() -> None:
    rng = np.random.default_rng(12)
    rays, _, _ = simulate(gruber_ground(1, rng), rotation(rng), rotation(rng), ORIGIN, B, rng)
    right = rays.right.copy()
    right[1, 1] += 0.5
    found = relative_orientation(RayPairs(rays.left, right, rays.left_sigma, rays.right_sigma))
    assert found.active.all()
    assert "cannot be told" in found.warnings[0]


def test_points_in_a_corner_are_oriented_with_a_warning() -> None:
    rng = np.random.default_rng(13)
    X = np.array([0.3, 0.5, -1.0]) + rng.uniform(-0.05, 0.05, (12, 3))
    rays, _, _ = simulate(X, rotation(rng), rotation(rng), ORIGIN, B, rng)
    assert "weak geometry" in relative_orientation(rays).warnings[0]


def test_points_behind_an_image_are_rejected() -> None:
    rng = np.random.default_rng(14)
    rays, _, _ = simulate(gruber_ground(4, rng, relief=0.05), rotation(rng), rotation(rng), ORIGIN, B, rng)
    # a mismatch along the epipolar line: the right point lies right of the left one
    left = np.vstack([rays.left, rays.left[:1]])
    right = np.vstack([rays.right, rays.right[:1] + 2 * (rays.left[0, 0] - rays.right[0, 0]) * np.eye(3)[:1]])
    sigma = np.full((len(left), 2), 0.05)
    found = relative_orientation(RayPairs(left, right, sigma, sigma))
    assert not found.active[-1]
    assert found.active[:-1].all()


def test_two_thousand_points_with_gross_errors_are_oriented() -> None:
    rng = np.random.default_rng(15)
    X = np.column_stack([rng.uniform(-0.2, 0.8, 2000), rng.uniform(-0.7, 0.7, 2000), rng.uniform(-1.1, -0.9, 2000)])
    rays, R, _ = simulate(X, rotation(rng), rotation(rng, kappa=3.0), ORIGIN, B, rng)
    right = rays.right.copy()
    right[::10, :2] += rng.uniform(-2, 2, (200, 2))
    found = relative_orientation(RayPairs(rays.left, right, rays.left_sigma, rays.right_sigma))
    np.testing.assert_allclose(found.left_from_right, R, atol=5e-5)
    assert (~found.active[::10]).sum() > 190
    assert (~np.delete(found.active, np.arange(0, 2000, 10))).sum() <= 2


def test_standard_deviations_far_too_small_end_in_an_orientation_with_a_warning() -> None:
    rng = np.random.default_rng(16)
    X = gruber_ground(10, rng, relief=0.05)
    for _ in range(10):
        rays, R, _ = simulate(X, rotation(rng), rotation(rng), ORIGIN, B, rng, sigma=0.015)
        sigma = rays.left_sigma / 3
        found = relative_orientation(RayPairs(rays.left, rays.right, sigma, sigma))
        np.testing.assert_allclose(found.left_from_right, R, atol=1e-3)
        assert found.sigma0 > 1.3
