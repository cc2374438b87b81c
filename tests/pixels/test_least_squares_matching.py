"""Least squares matching: a patch that was moved, turned and sheared by known amounts is found there."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from aatri.pixels.least_squares_matching import least_squares_match, part_shifts
from tests.made_photographs import texture


@pytest.mark.parametrize("negative", [False, True])
def test_a_patch_is_found_to_a_hundredth_of_a_pixel(negative: bool) -> None:
    ground = texture()[:200, :200]
    A, p = np.array([[1.05, 0.08], [-0.06, 0.97]]), np.array([60.3, 57.8])
    rows, columns = np.indices((21, 21)) - 10
    at = np.stack([columns.ravel(), rows.ravel()], axis=1) @ A.T + p  # the patch shows the image through A
    patch = map_coordinates(ground, at.T[::-1], order=5).reshape(21, 21)
    rng = np.random.default_rng(1)
    image = 0.8 * (255 - ground if negative else ground) + 20 + rng.normal(0, 2, ground.shape)
    found = least_squares_match(image, patch, p + np.array([1.2, -0.9]), "affine")
    assert found is not None
    assert np.abs(found.xy_px - p).max() < 0.05
    assert np.abs(found.linear - A).max() < 0.01
    assert (found.correlation < 0) == negative
    assert (np.abs(found.xy_px - p) < 3 * found.sigma_px(part_shifts([found]))).all()


def test_plain_ground_and_the_edge_match_nothing() -> None:
    flat = np.full((60, 60), 100.0)
    assert least_squares_match(flat, np.full((21, 21), 50.0), np.array([30.0, 30.0])) is None
    assert least_squares_match(texture()[:60, :60], texture()[:21, :21], np.array([5.0, 30.0])) is None
