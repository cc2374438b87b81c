"""Thinning: every cell keeps points, long tracks come first, weak images keep all."""

from __future__ import annotations

import numpy as np

from aatri.pixels.thinning import kept_points


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
