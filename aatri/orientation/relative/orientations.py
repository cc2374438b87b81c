"""Relative orientations of pairs, with the points of their models, pair by pair."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.geometry.coplanarity import parallax
from aatri.geometry.intersection import intersect_pair
from aatri.orientation.relative.image_pairs import ImagePairs

PER_POINT = ("active", "parallax_mm", "error_mm", "error_sigma_mm", "test", "xyz", "point_covariance", "depth")
PER_PAIR = ("formed", "left_from_right", "base", "covariance", "sigma0", "redundancy", "iterations")


@dataclass(frozen=True)
class RelativeOrientations:
    """Relative orientations of pairs, and their models.

    Attributes
    ----------
    formed : (m,) bool
        The rows of the other pairs are NaN and 0.
    left_from_right, base : (m, 3, 3), (m, 3) float64
        Rotation of the right image into the frame of the left one, unit vector between them.
    covariance : (m, 5, 5) float64, rad^2
        Of the rotation increment and the turn of the base, a priori (sigma0 = 1).
    sigma0 : (m,) float64
        NaN without redundancy.
    redundancy, iterations : (m,) int64
    active : (n,) bool
        Points used in the orientation.
    parallax_mm : (n,) float64, mm
        y-parallax.
    error_mm, error_sigma_mm : (n,) float64, mm
        Estimated gross error of the y-parallax and its standard deviation; NaN where uncontrolled.
    test : (n,) float64
        |error| / sigma; NaN where uncontrolled.
    xyz, point_covariance, depth : (n, 3), (n, 3, 3), (n, 2) float64
        Model points, as of `geometry.intersection.Intersection`.
    reasons : dict
        Why a pair makes no model, by pair.
    warnings : dict
        Of formed pairs, by pair.
    scale : float
        What the standard deviations of the image points were multiplied by, see `image_scale`; covariances, tests and
        errors are with it, sigma0 is not.
    """

    formed: Bool
    left_from_right: Float
    base: Float
    covariance: Float
    sigma0: Float
    redundancy: Int
    iterations: Int
    active: Bool
    parallax_mm: Float
    error_mm: Float
    error_sigma_mm: Float
    test: Float
    xyz: Float
    point_covariance: Float
    depth: Float
    reasons: dict[int, str] = field(default_factory=dict)
    warnings: dict[int, tuple[str, ...]] = field(default_factory=dict)
    scale: float = 1.0

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
        for names, here, there in ((PER_PAIR, pairs, its_pairs), (PER_POINT, rows, its_rows)):
            for name in names:
                getattr(self, name)[here] = getattr(other, name)[there]


@dataclass(frozen=True)
class PairSettings:
    """How pairs are adjusted.

    Attributes
    ----------
    limit : float
        Largest test statistic of a point that is used.
    max_iterations : int
        Of one adjustment.
    min_points : int
        Used points of a model, five at least.
    """

    limit: float
    max_iterations: int
    min_points: int


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
