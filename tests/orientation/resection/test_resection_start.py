"""The three-point start finds any orientation, oblique and upside down too."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.geometry.rotations import exp_rotation, rotation_from_angles
from aatri.orientation.resection.start import linear_orientation, start_orientation, three_point


def _image(seed: int, n: int):
    rng = np.random.default_rng(seed)
    R = exp_rotation(rng.normal(size=3) * 2)
    X0 = np.array([446000.0, 4505000.0, 400.0]) + rng.normal(0, 500, 3)
    local = np.column_stack([rng.uniform(-100, 100, (n, 2)), np.full(n, -150.0)]) * rng.uniform(2, 4, (n, 1))
    return R, X0, X0 + local @ R.T, -150.0 * local[:, :2] / local[:, 2:]


@pytest.mark.parametrize("seed", range(30))
def test_any_orientation_is_found_from_error_free_points(seed: int) -> None:
    R, X0, xyz, xy = _image(seed, 8)
    found = start_orientation(xy, 150.0, xyz)
    assert found is not None
    np.testing.assert_allclose(found[0], X0, atol=1e-3)
    np.testing.assert_allclose(found[1], R, atol=1e-5)


def test_one_gross_error_does_not_mislead_the_start() -> None:
    R, X0, xyz, xy = _image(99, 10)
    xy[3] += 30.0
    found = start_orientation(xy, 150.0, xyz)
    assert found is not None
    np.testing.assert_allclose(found[0], X0, atol=1e-3)
    np.testing.assert_allclose(found[1], R, atol=1e-5)


def test_all_solutions_of_three_points_see_them_along_their_rays() -> None:
    xyz = np.array([[0.0, 0.0, 0.0], [100.0, 10.0, 3.0], [20.0, 90.0, -5.0]])
    X0, R = np.array([40.0, 30.0, 150.0]), rotation_from_angles([0.05, -0.1, 1.0])
    rays = (xyz - X0) @ R
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    solutions = three_point(rays, xyz)
    for position, rotation in solutions:
        seen = (xyz - position) @ rotation
        np.testing.assert_allclose(seen / np.linalg.norm(seen, axis=1, keepdims=True), rays, atol=1e-6)
    assert any(np.allclose(position, X0, atol=1e-6) for position, _ in solutions)


def test_three_points_are_not_enough_to_choose() -> None:
    _, _, xyz, xy = _image(1, 3)
    assert start_orientation(xy, 150.0, xyz) is None


# -- the direct linear transformation as start --


@pytest.mark.parametrize("seed", range(20))
def test_any_orientation_is_found_from_six_error_free_points(seed: int) -> None:
    R, X0, xyz, xy = _image(seed, 6)
    found = linear_orientation(xy, 150.0, xyz)
    assert found is not None
    np.testing.assert_allclose(found[0], X0, atol=1e-4)
    np.testing.assert_allclose(found[1], R, atol=1e-6)


def test_noise_moves_it_by_what_the_rays_allow() -> None:
    R, X0, xyz, xy = _image(5, 40)
    found = linear_orientation(xy + np.random.default_rng(1).normal(0, 0.005, xy.shape), 150.0, xyz)
    assert found is not None
    assert np.linalg.norm(found[0] - X0) < 1.0
    assert np.abs(found[1] - R).max() < 3e-3


def test_five_points_and_points_in_a_plane_leave_it_open() -> None:
    _, _, xyz, xy = _image(1, 6)
    assert linear_orientation(xy[:5], 150.0, xyz[:5]) is None
    flat = xyz.copy()
    flat[:, 2] = 100.0
    assert linear_orientation(xy, 150.0, flat) is None
