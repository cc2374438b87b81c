"""The graph of pairs: images are its nodes, relative orientations with their points its edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Bool, Float, Int, ranges


@dataclass(frozen=True)
class RotationPairs:
    """Pairs of images of which the rotation is known and no base."""

    left: Int
    right: Int
    """(k,)."""
    left_from_right: Float
    """(k, 3, 3)."""
    sigma_rad: Float
    """(k,), rad."""
    points: Int
    """(k,)."""


@dataclass(frozen=True)
class PairGraph:
    """Oriented pairs and their points, pair by pair."""

    images: int
    left: Int
    right: Int
    """(m,)."""
    left_from_right: Float
    """(m, 3, 3)."""
    base: Float
    """(m, 3). Unit vectors in the frame of the left image."""
    rotation_sigma_rad: Float
    base_sigma_rad: Float
    """(m,), rad. Of the least certain direction."""
    start: Int
    """(m + 1,). First point of each pair."""
    point: Int
    """(n,)."""
    depth: Float
    """(n, 2). Distances from the left and right projection centre, in units of the base."""
    parallax_rad: Float
    """(n,), rad. Angle between both rays."""
    second: Float
    """(m, 3, 3). Rotation that explains the points of the pair as well; NaN where there is none."""

    @property
    def inliers(self) -> Int:
        """Points of each pair."""
        return np.diff(self.start)

    @property
    def pair_of_point(self) -> Int:
        """Pair of each row of the points."""
        return np.repeat(np.arange(len(self.left)), self.inliers)

    def take(self, pairs: Bool | Int) -> PairGraph:
        """The chosen pairs."""
        pairs = np.flatnonzero(pairs) if pairs.dtype == bool else pairs
        count = self.inliers[pairs]
        rows = ranges(self.start[pairs], count)
        return PairGraph(
            self.images,
            self.left[pairs],
            self.right[pairs],
            self.left_from_right[pairs],
            self.base[pairs],
            self.rotation_sigma_rad[pairs],
            self.base_sigma_rad[pairs],
            np.concatenate([[0], np.cumsum(count)]),
            self.point[rows],
            self.depth[rows],
            self.parallax_rad[rows],
            self.second[pairs],
        )

    def strength(self) -> Float:
        """How well a pair carries scale: root of its points times their median parallax, (m,)."""
        order = np.lexsort((self.parallax_rad, self.pair_of_point))
        middle = self.parallax_rad[order][np.minimum(self.start[:-1] + self.inliers // 2, len(order) - 1)]
        return np.asarray(np.sqrt(self.inliers) * middle)
