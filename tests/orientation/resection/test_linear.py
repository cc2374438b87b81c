"""The direct linear transformation as start of a resection."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.orientation.resection.linear import linear_orientation
from tests.orientation.resection.test_resection_start import _image


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
