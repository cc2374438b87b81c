"""Which pairs of images are oriented, where not all are."""

from __future__ import annotations

import numpy as np

from aatri.adapters.pairs.image_pairs import joining_pairs, strongest_pairs


def test_the_pair_of_few_points_that_joins_two_parts_is_among_the_strongest_of_each_image() -> None:
    """Two parts of five images, each paired with each; 7 points in common join them, and 6 elsewhere."""
    left, right = np.triu_indices(10, k=1)
    within = (left < 5) == (right < 5)
    common = np.where(within, 20 + left + right, np.where((left == 0) & (right == 9), 7, 5))
    common[(left == 0) & (right == 1)] = 6
    images = np.column_stack([left, right])
    joining = joining_pairs(images, common, 10, 8, 6)
    images, common = images[joining], common[joining]
    assert joining.sum() == 2 * 10 - 1 + 1  # without the pair of 6 points, whose images others join
    kept = strongest_pairs(images, common, 10, 3, 8)
    assert images[kept & (common < 8)].tolist() == [[0, 9]]
    assert np.bincount(images[kept & (common >= 8)].ravel(), minlength=10).min() >= 3
    assert (kept & (common >= 8)).sum() < 2 * 10 - 1
