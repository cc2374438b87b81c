"""Space resection: the orientation of single images from known ground points, many images at once.

Each image is a problem of its own with six unknowns, X0 and the increment d (R <- exp([d]x) R), solved by Gauss-Newton
on the collinearity equations from approximate orientations. The normal equations of all images are formed and solved
together. Gross errors are held down by Huber weights at `HUBER` standard deviations of the image's own spread.

Source: Kraus, Photogrammetry; photogrammetry.md A906.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.geometry.collinearity import collinearity
from aatri.geometry.rotations import exp_rotation

HUBER = 3.0
MIN_POINTS = 3
DECREMENT = 1e-6


@dataclass(frozen=True)
class ResectedImages:
    """Orientations by resection.

    Attributes
    ----------
    position_m : (n, 3) float64, m
    ground_from_image : (n, 3, 3) float64
    resected : (n,) bool
        False where fewer than 3 points are known, they lie on a line, or the iteration did not converge; the start
        values are returned there.
    covariance : (n, 6, 6) float64, m and rad
        A priori, of X0 and d; NaN where not resected.
    rms_mm : (n,) float64, mm
        RMS residual; NaN where not resected.
    points : (n,) int32
        Points used.
    """

    position_m: Float
    ground_from_image: Float
    resected: Bool
    covariance: Float
    rms_mm: Float
    points: Int


def resect_images(
    xy_mm: Float,
    sigma_mm: Float,
    image: Int,
    point: Int,
    c_mm: Float,
    xyz_m: Float,
    position_m: Float,
    ground_from_image: Float,
    *,
    max_iterations: int = 50,
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
    max_iterations : int

    Returns
    -------
    ResectedImages
    """
    n_images = len(c_mm)
    known = np.isfinite(xyz_m[point]).all(axis=1) & np.isfinite(xy_mm).all(axis=1)
    known &= np.isfinite(position_m[image]).all(axis=1) & np.isfinite(ground_from_image[image]).all(axis=(1, 2))
    xy, sigma, image, X = xy_mm[known], sigma_mm[known], image[known], xyz_m[point[known]]
    count = np.bincount(image, minlength=n_images).astype(np.int32)
    origin = np.nanmean(X, axis=0) if len(X) else np.zeros(3)
    X0, R = position_m - origin, ground_from_image.copy()
    X = X - origin
    working = count >= MIN_POINTS
    done = np.zeros(n_images, dtype=bool)
    robust = np.ones(len(xy))
    covariance = np.full((n_images, 6, 6), np.nan)
    rms = np.full(n_images, np.nan)
    for _ in range(max_iterations):
        rays = np.flatnonzero((working & ~done)[image])
        if not len(rays):
            break
        rows = image[rays]
        computed, by_pose, _ = collinearity(X0[rows], R[rows], X[rays], c_mm[rows])
        v = (computed - xy[rays]) / sigma[rays]
        J = by_pose / sigma[rays][:, :, None]
        N, g = _sums(J, v, robust[rays], rows, n_images)
        solvable = (working & ~done) & _well_posed(N)
        working &= solvable | done
        chosen = np.flatnonzero(solvable)
        Q = np.linalg.inv(N[chosen])
        dx = -np.einsum("nij,nj->ni", Q, g[chosen])
        decrement = np.sqrt(np.abs(np.einsum("ni,nij,nj->n", dx, N[chosen], dx)))
        spread = np.sqrt(np.bincount(rows, (v**2).sum(axis=1), minlength=n_images) / np.maximum(2 * count, 1))
        X0[chosen] += dx[:, :3]
        R[chosen] = exp_rotation(dx[:, 3:]) @ R[chosen]
        covariance[chosen], rms[chosen] = Q, (spread * _mean_sigma(sigma[rays], rows, n_images))[chosen]
        changed = _reweight(robust, rays, v, rows, n_images)
        done[chosen] = (decrement <= DECREMENT) & ~changed[chosen]
    failed = ~done
    covariance[failed], rms[failed] = np.nan, np.nan
    return ResectedImages(
        np.where(done[:, None], X0 + origin, position_m),
        np.where(done[:, None, None], R, ground_from_image),
        done,
        covariance,
        rms,
        np.where(done, count, 0).astype(np.int32),
    )


def _sums(J: Float, v: Float, weight: Float, rows: Int, n: int) -> tuple[Float, Float]:
    N, g = np.zeros((n, 6, 6)), np.zeros((n, 6))
    np.add.at(N, rows, np.einsum("nki,nkj,n->nij", J, J, weight))
    np.add.at(g, rows, np.einsum("nki,nk,n->ni", J, v, weight))
    return N, g


def _well_posed(N: Float) -> Bool:
    scale = np.sqrt(np.maximum(np.einsum("nii->ni", N), 1e-300))
    unit = N / (scale[:, :, None] * scale[:, None, :])
    finite = np.isfinite(unit).all(axis=(1, 2))
    lowest = np.linalg.eigvalsh(np.where(finite[:, None, None], unit, np.eye(6)))[:, 0]
    return np.asarray(finite & (lowest > 1e-13))


def _mean_sigma(sigma: Float, rows: Int, n: int) -> Float:
    total = np.bincount(rows, sigma.mean(axis=1), minlength=n)
    return np.asarray(total / np.maximum(np.bincount(rows, minlength=n), 1))


def _reweight(robust: Float, rays: Int, v: Float, rows: Int, n: int) -> Bool:
    """Huber weights by the image's own median spread; returns which images' weights still change."""
    size = np.sqrt((v**2).mean(axis=1))
    order = np.lexsort((size, rows))
    starts = np.searchsorted(rows[order], np.arange(n))
    counts = np.bincount(rows, minlength=n)
    middle = np.minimum(starts + counts // 2, len(order) - 1)
    median = np.where(counts > 0, size[order][middle], 1.0)
    limit = HUBER * np.maximum(1.5 * median, 1.0)[rows]
    weight = np.where(size > limit, limit / np.maximum(size, 1e-300), 1.0)
    changed = np.zeros(n, dtype=bool)
    np.logical_or.at(changed, rows, np.abs(weight - robust[rays]) > 1e-3)
    robust[rays] = weight
    return changed
