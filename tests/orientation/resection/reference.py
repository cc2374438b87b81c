"""Space resection in NumPy, all images in step: the reference of the compiled form, which goes image by image.

The rank is judged by the eigenvalues of the normal equations scaled to unit diagonal.
"""

from __future__ import annotations

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.geometry.collinearity import collinearity
from aatri.geometry.rotations import exp_rotation

DETERMINED = 1e-13
"""Smallest eigenvalue of the normal equations, scaled to unit diagonal, of an image that is determined."""


def resect_in_step(
    xy: Float,
    sigma: Float,
    image: Int,
    X: Float,
    c_mm: Float,
    X0: Float,
    R: Float,
    working: Bool,
    huber: float,
    tolerance: float,
    max_iterations: int,
) -> tuple[Float, Float, Float, Float, Bool]:
    """Resect the images that are `working`.

    Parameters
    ----------
    xy, sigma : (n, 2) float64, mm
    image : (n,) int
    X : (n, 3) float64, m
        Ground point of each ray.
    c_mm : (n_images,) float64, mm
    X0, R : (n_images, 3), (n_images, 3, 3) float64
        Start.
    working : (n_images,) bool
    huber, tolerance, max_iterations
        Of the method.

    Returns
    -------
    X0 : (n_images, 3) float64, m
    R : (n_images, 3, 3) float64
    covariance : (n_images, 6, 6) float64
    spread : (n_images,) float64
        Root mean square of the whitened residuals.
    done : (n_images,) bool
        The other rows of the results are not to be used.
    """
    n_images = len(c_mm)
    X0, R, working = X0.copy(), R.copy(), working.copy()
    count = np.bincount(image, minlength=n_images)
    done = np.zeros(n_images, dtype=bool)
    robust = np.ones(len(xy))
    covariance = np.full((n_images, 6, 6), np.nan)
    spread = np.full(n_images, np.nan)
    rays = np.flatnonzero(working[image])
    computed = collinearity(X0[image[rays]], R[image[rays]], X[rays], c_mm[image[rays]])[0]
    _reweight(robust, rays, (computed - xy[rays]) / sigma[rays], image[rays], n_images, huber)
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
        square = np.bincount(rows, (v**2).sum(axis=1), minlength=n_images)
        X0[chosen] += dx[:, :3]
        R[chosen] = exp_rotation(dx[:, 3:]) @ R[chosen]
        covariance[chosen], spread[chosen] = Q, np.sqrt(square[chosen] / (2 * count[chosen]))
        changed = _reweight(robust, rays, v, rows, n_images, huber)
        done[chosen] = (decrement <= tolerance) & ~changed[chosen]
    return X0, R, covariance, spread, done


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
    return np.asarray(finite & (lowest > DETERMINED))


def _reweight(robust: Float, rays: Int, v: Float, rows: Int, n: int, huber: float) -> Bool:
    """Huber weights by the image's own median spread; returns which images' weights still change."""
    size = np.sqrt((v**2).mean(axis=1))
    order = np.lexsort((size, rows))
    starts = np.searchsorted(rows[order], np.arange(n))
    counts = np.bincount(rows, minlength=n)
    middle = np.minimum(starts + counts // 2, len(order) - 1)
    median = np.where(counts > 0, size[order][middle], 1.0)
    limit = huber * np.maximum(1.5 * median, 1.0)[rows]
    weight = np.where(size > limit, limit / np.maximum(size, 1e-300), 1.0) * (size <= 10 * limit)
    changed = np.zeros(n, dtype=bool)
    np.logical_or.at(changed, rows, np.abs(weight - robust[rays]) > 1e-3)
    robust[rays] = weight
    return changed
