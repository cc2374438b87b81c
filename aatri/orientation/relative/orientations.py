"""Pairs of images with the points that they have in common; their relative orientations, with the points of models."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from aatri.adjustment.threads import in_threads
from aatri.arrays import Bool, Float, Int
from aatri.geometry.coplanarity import RayPairs, parallax
from aatri.geometry.intersection import intersect_pair
from aatri.orientation.relative.kernels.common_points import count_common, find_common

PAIRS_A_THREAD = 5_000
"""Pairs of images for which a thread of their own pays."""

PER_POINT = ("active", "parallax_mm", "error_mm", "error_sigma_mm", "test", "xyz", "point_covariance", "depth")
PER_PAIR = ("formed", "left_from_right", "base", "covariance", "sigma0", "redundancy", "iterations")


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


@dataclass(frozen=True)
class RelativeOrientations:
    """Relative orientations of pairs, and their models."""

    formed: Bool
    """(m,). The rows of the other pairs are NaN and 0."""
    left_from_right: Float
    base: Float
    """(m, 3, 3), (m, 3). Rotation of the right image into the frame of the left one, unit vector between them."""
    covariance: Float
    """(m, 5, 5), rad^2. Of the rotation increment and the turn of the base, a priori (sigma0 = 1)."""
    sigma0: Float
    """(m,). NaN without redundancy."""
    redundancy: Int
    iterations: Int
    """(m,) int64."""
    active: Bool
    """(n,). Points used in the orientation."""
    parallax_mm: Float
    """(n,), mm. y-parallax."""
    error_mm: Float
    error_sigma_mm: Float
    """(n,), mm. Estimated gross error of the y-parallax and its standard deviation; NaN where uncontrolled."""
    test: Float
    """(n,). |error| / sigma; NaN where uncontrolled."""
    xyz: Float
    point_covariance: Float
    depth: Float
    """(n, 3), (n, 3, 3), (n, 2). Model points, as of `geometry.intersection.Intersection`."""
    reasons: dict[int, str] = field(default_factory=dict)
    """Why a pair makes no model, by pair."""
    warnings: dict[int, tuple[str, ...]] = field(default_factory=dict)
    """Of formed pairs, by pair."""
    scale: float = 1.0
    """What the standard deviations of the image points were multiplied by, see `image_scale`; covariances, tests and
    errors are with it, sigma0 is not."""

    @staticmethod
    def empty(m: int, n: int) -> RelativeOrientations:
        """Of m pairs with n points, none of them formed."""
        nan = np.nan
        return RelativeOrientations(
            np.zeros(m, dtype=bool),
            np.full((m, 3, 3), nan),
            np.full((m, 3), nan),
            np.full((m, 5, 5), nan),
            np.full(m, nan),
            np.zeros(m, dtype=np.int64),
            np.zeros(m, dtype=np.int64),
            np.zeros(n, dtype=bool),
            np.full(n, nan),
            np.full(n, nan),
            np.full(n, nan),
            np.full(n, nan),
            np.full((n, 3), nan),
            np.full((n, 3, 3), nan),
            np.full((n, 2), nan),
        )

    def put(
        self, pairs: Int, rows: Int, other: RelativeOrientations, its_pairs: Int | int, its_rows: Int | int
    ) -> None:
        """Fill in pairs, and points, from the rows of others."""
        for names, whole_table, portion in ((PER_PAIR, pairs, its_pairs), (PER_POINT, rows, its_rows)):
            for name in names:
                getattr(self, name)[whole_table] = getattr(other, name)[portion]


@dataclass(frozen=True)
class PairSettings:
    """How pairs are adjusted."""

    limit: float
    """Largest test statistic of a point that is used."""
    max_iterations: int
    """Of one adjustment."""
    min_points: int
    """Used points of a model, five at least."""


def rows_of_pairs(start: Int, pairs: Int) -> Int:
    """Rows of the points of the chosen pairs, pair by pair."""
    count = np.diff(start)[pairs]
    return np.asarray(np.arange(int(count.sum())) + np.repeat(start[pairs] - np.cumsum(count) + count, count))


def refresh_points(orientations: RelativeOrientations, pairs: ImagePairs, pair: int) -> None:
    """Model points and y-parallaxes of a pair whose orientation has changed."""
    rows, R, base = pairs.rows(pair), orientations.left_from_right[pair], orientations.base[pair]
    rays = pairs.rays.take(rows)
    points = intersect_pair(R, base, rays)
    orientations.xyz[rows], orientations.depth[rows] = points.xyz, points.depth
    orientations.point_covariance[rows] = points.covariance
    orientations.parallax_mm[rows] = parallax(R, base, rays)[0]
    orientations.active[rows] &= (points.depth > 0).all(axis=1)


@dataclass(frozen=True)
class EssentialOrientations:
    """Relative orientations without start."""

    orientations: RelativeOrientations
    second: Float
    """(m, 3, 4). Rotation and base of another orientation that explains the points as well; NaN where there is none."""
    turned: Float
    """(m, 3, 3). Rotation of the right image into the frame of the left one where the images have no base; else NaN."""
    turned_sigma_rad: Float
    """(m,), rad."""
    turned_points: Int
    """(m,) int64. Points that the rotation explains."""
    samples: Int
    """(m,) int64. Five-point samples drawn."""
