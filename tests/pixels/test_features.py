"""Features: where they lie to the hundredth of a pixel, once per place, and spread."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from aatri.pixels.features import keypoints_of, rank_in, spread
from aatri.pixels.thinning import kept_points
from tests.made_photographs import texture

pytest.importorskip("cv2")


@pytest.fixture(scope="module")
def grey() -> np.ndarray:
    return np.clip(texture()[:600, :800], 0, 255).astype(np.uint8)


@pytest.mark.slow
def test_a_turned_image_has_its_features_at_the_turned_places(grey: np.ndarray) -> None:
    """OpenCV's default lies 0.25 px off in each image, 0.5 between them."""
    here, turned = keypoints_of(grey, 3000), keypoints_of(np.ascontiguousarray(grey[::-1, ::-1]), 3000)
    back = np.array([grey.shape[1] - 1, grey.shape[0] - 1]) - turned.xy_px
    distance, nearest = cKDTree(back).query(here.xy_px)
    same = distance < 1.0
    assert same.sum() > 500
    off = here.xy_px[same] - back[nearest[same]]
    assert np.abs(np.median(off, axis=0)).max() < 0.01


def test_no_place_has_two_features_and_every_cell_some(grey: np.ndarray) -> None:
    keypoints = keypoints_of(grey, 1000, cells=8)
    assert len(keypoints) == 1000
    assert len(np.unique(np.round(keypoints.xy_px, 2), axis=0)) == len(keypoints)
    assert keypoints.descriptor.shape == (1000, 128)
    cell = (keypoints.xy_px // 100).astype(int)
    assert len(np.unique(cell, axis=0)) == 8 * 6


def test_a_mask_keeps_features_out(grey: np.ndarray) -> None:
    seen = np.ones(grey.shape, bool)
    seen[:, :400] = False
    assert keypoints_of(grey, 500, seen=seen).xy_px[:, 0].min() > 399


def test_nothing_is_found_on_plain_water() -> None:
    assert len(keypoints_of(np.full((200, 300), 90, np.uint8), 500)) == 0


def test_spreading_takes_cells_and_scales_in_turn() -> None:
    xy = np.array([[10.0, 10], [12, 10], [14, 10], [90, 90]])
    kept = spread(xy, np.array([3.0, 3, 20, 3]), np.array([9.0, 8, 1, 0.1]), (100, 100), 3, 2)
    assert sorted(kept.tolist()) == [0, 2, 3]  # a small and the large one of the first cell, and the other cell
    assert rank_in(np.array([1, 0, 1]), np.array([5.0, 1.0, 4.0])).tolist() == [1, 0, 0]


# -- thinning: every cell keeps points, long tracks come first, weak images keep all --


def test_long_tracks_fill_cells_and_short_ones_go() -> None:
    # point 0 in three images, points 1 and 2 in two; all in the same cells
    point = np.array([1, 1, 0, 0, 0, 2, 2])
    image = np.array([0, 1, 0, 1, 2, 0, 1])
    cell = np.zeros(7, int)
    kept = kept_points(point, image, cell, np.array([1.0, 1, 1, 1, 1, 0.5, 0.5]), per_cell=1, least=0)
    assert kept.tolist() == [False, False, True, True, True, False, False]
    two = kept_points(point, image, cell, np.array([1.0, 1, 1, 1, 1, 0.5, 0.5]), per_cell=2, least=0)
    assert two.tolist() == [False, False, True, True, True, True, True]  # the more precise one
    assert kept_points(point, image, cell, np.ones(7), per_cell=1, least=3).all()


def test_every_cell_that_had_points_has_some() -> None:
    rng = np.random.default_rng(2)
    point = np.repeat(np.arange(2000), 3)
    image = np.tile(np.arange(3), 2000)
    cell = rng.integers(0, 64, 6000)
    kept = kept_points(point, image, cell, rng.random(6000), per_cell=2, least=0)
    assert kept.sum() < 2500
    assert (kept.reshape(-1, 3).all(axis=1) | ~kept.reshape(-1, 3).any(axis=1)).all()  # points stay whole
    assert len(np.unique(np.column_stack([image, cell])[kept], axis=0)) == 3 * 64
