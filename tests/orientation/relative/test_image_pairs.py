"""Common points of pairs of images."""

from __future__ import annotations

import numpy as np

from aatri.orientation.relative.image_pairs import common_points


def test_common_points_are_those_of_both_images_in_order() -> None:
    rng = np.random.default_rng(2)
    seen = [np.sort(rng.choice(60, n, replace=False)) for n in (0, 5, 40, 60, 33)]
    point, begin = np.concatenate(seen), np.concatenate([[0], np.cumsum([len(s) for s in seen])])
    images = np.array([[0, 1], [1, 2], [2, 3], [2, 4], [3, 4], [4, 1]])
    start, left, right = common_points(images, begin, point)
    assert start[0] == 0
    for k, (a, b) in enumerate(images):
        both = np.intersect1d(seen[a], seen[b])
        rows = slice(start[k], start[k + 1])
        np.testing.assert_array_equal(point[left[rows]], both)
        np.testing.assert_array_equal(point[right[rows]], both)
        assert ((left[rows] >= begin[a]) & (left[rows] < begin[a + 1])).all()
        assert ((right[rows] >= begin[b]) & (right[rows] < begin[b + 1])).all()


def test_no_pairs_have_no_common_points() -> None:
    start, left, right = common_points(
        np.zeros((0, 2), dtype=np.intp), np.zeros(1, dtype=np.int64), np.zeros(0, dtype=np.int64)
    )
    assert start.tolist() == [0]
    assert len(left) == len(right) == 0
