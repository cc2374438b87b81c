"""Space resection: the orientation of single images from known ground points, many images at once.

Each image is a problem of its own with six unknowns, X0 and the increment d (R <- exp([d]x) R), solved by Gauss-Newton
on the collinearity equations from approximate orientations, one compiled loop over the images. Gross errors are held
down by Huber weights at `HUBER` standard deviations of the image's own spread; the grossest have no weight.

Source: Kraus, Photogrammetry; docs/formulas.md 3.7.
"""

from dataclasses import dataclass

import numpy as np

from aatri.adjustment.threads import in_threads, items_between
from aatri.arrays import Bool, Float, Int, finite_rows
from aatri.geometry.limits import MIN_POINTS
from aatri.orientation.resection.kernels.resection import resect

HUBER = 3.0
DECREMENT = 1e-6
MOST_ITERATIONS = 50
WORTH_A_THREAD = 5_000
"""Rays for which a thread of their own pays."""


@dataclass(frozen=True)
class ResectedImages:
    """Orientations by resection."""

    position_m: Float
    """(n, 3), m."""
    ground_from_image: Float
    """(n, 3, 3)."""
    resected: Bool
    """(n,). False where fewer than 3 points are known, they lie on a line, or the iteration did not converge; the start
    values are returned there."""
    covariance: Float
    """(n, 6, 6), m and rad. A priori, of X0 and d; NaN where not resected."""
    rms_mm: Float
    """(n,), mm. RMS residual; NaN where not resected."""
    points: Int
    """(n,) int32. Points used."""


def resect_images(
    xy_mm: Float,
    sigma_mm: Float,
    image: Int,
    point: Int,
    c_mm: Float,
    xyz_m: Float,
    position_m: Float,
    ground_from_image: Float,
) -> ResectedImages:
    """Resect images from approximate orientations.

    Parameters
    ----------
    xy_mm, sigma_mm : (n, 2) float64, mm, from the principal point
    image, point : (n,) int, rows
    c_mm : (n_images,) float64, mm
    xyz_m : (n_points, 3) float64, m
        NaN where unknown: such rays are left out.
    position_m : (n_images, 3) float64, m
        Start; NaN where unknown.
    ground_from_image : (n_images, 3, 3) float64
        Start.
    """
    n_images, has_coordinates = len(c_mm), finite_rows(xyz_m)
    oriented = finite_rows(position_m) & np.isfinite(ground_from_image).all(axis=(1, 2))
    rays = np.flatnonzero(has_coordinates[point] & oriented[image] & finite_rows(xy_mm))
    rays = rays[np.argsort(image[rays], kind="stable")]
    xy, weight, row = xy_mm[rays], sigma_mm[rays], image[rays]
    count = np.bincount(row, minlength=n_images)
    mean_sigma = np.bincount(row, weight.mean(axis=1), minlength=n_images) / np.maximum(count, 1)
    np.reciprocal(weight, out=weight)  # arrays of all image points are large
    seen = np.zeros(len(xyz_m), dtype=bool)
    seen[point[rays]] = True
    origin = xyz_m[seen].mean(axis=0) if seen.any() else np.zeros(3)
    X = (xyz_m - origin)[point[rays]]
    del rays, row
    first = np.concatenate([[0], np.cumsum(count)]).astype(np.int64)
    X0 = np.array(position_m - origin, dtype=np.float64, order="C")
    R = np.array(ground_from_image, dtype=np.float64, order="C")
    Q, spread, done = np.full((n_images, 6, 6), np.nan), np.full(n_images, np.nan), np.zeros(n_images, dtype=bool)
    arguments = (
        first,
        X,
        xy,
        weight,
        np.array(c_mm, dtype=np.float64),
        MIN_POINTS,
        HUBER,
        DECREMENT,
        MOST_ITERATIONS,
        X0,
        R,
        Q,
        spread,
        done,
    )
    in_threads(len(xy), lambda a, b: resect(*items_between(first, a, b), *arguments), worth=WORTH_A_THREAD)
    return ResectedImages(
        np.where(done[:, None], X0 + origin, position_m),
        np.where(done[:, None, None], R, ground_from_image),
        done,
        np.where(done[:, None, None], Q, np.nan),
        np.where(done, spread * mean_sigma, np.nan),
        np.where(done, count, 0).astype(np.int32),
    )
