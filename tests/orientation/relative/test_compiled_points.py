"""Intersection of model points, compiled: when rays are parallel."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.orientation.relative.kernels.model_points import PARALLEL, intersect

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
