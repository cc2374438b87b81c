"""Pairs of images with the points that they have in common."""

from dataclasses import dataclass

import numpy as np

from aatri.adjustment.threads import in_threads
from aatri.arrays import Int
from aatri.geometry.coplanarity import RayPairs
from aatri.orientation.relative.kernels.common_points import count_common, find_common

PAIRS_A_THREAD = 5_000
"""Pairs of images for which a thread of their own pays."""


@dataclass(frozen=True)
class ImagePairs:
    """Pairs of images and their common points, pair by pair and by point."""

    left: Int
    right: Int
    """(m,) int32. Rows in images."""
    start: Int
    """(m + 1,) int64. First common point of each pair; the last is their number."""
    point: Int
    """(n,) int32. Rows in points, ascending within a pair."""
    left_row: Int
    right_row: Int
    """(n,) int32. Rows of the measurements."""
    rays: RayPairs

    def rows(self, pair: int) -> Int:
        """Rows of the points of a pair."""
        return np.arange(self.start[pair], self.start[pair + 1])


def common_points(images: Int, begin: Int, point: Int) -> tuple[Int, Int, Int]:
    """First common point of each pair, and the rows of all of them in both images.

    Parameters
    ----------
    images : (m, 2) int
    begin : (n_images + 1,) int
        First row of each image in `point`.
    point : (n,) int
        Ascending within an image.

    Returns
    -------
    start : (m + 1,) int64
        The last is the number of common points.
    left, right : (k,) int64
    """
    m, count = len(images), np.zeros(len(images), dtype=np.int64)
    images, begin, point = (np.ascontiguousarray(a, dtype=np.int64) for a in (images, begin, point))
    in_threads(m, lambda a, b: count_common(a, b, images, begin, point, count), worth=PAIRS_A_THREAD)
    start = np.concatenate([[0], np.cumsum(count)])
    left, right = (np.empty(int(start[-1]), dtype=np.int64) for _ in range(2))
    in_threads(m, lambda a, b: find_common(a, b, images, begin, point, start, left, right), worth=PAIRS_A_THREAD)
    return start, left, right
