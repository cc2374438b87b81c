"""Space resection image by image, compiled; the method is that of `resection.adjustment`.

With u = R'(X - X0) the row of a residual is J = (-q, q x (X - X0)), q = du'(dx/du) turned to the ground: the derivative
to the ground point. The rows are not stored, their products are added to the normal equations at once.
"""

import numpy as np
from numba import njit

from aatri.adjustment.kernels.small import DETERMINED, OPTIONS, inverse, inverse_root, newton_step, select
from aatri.geometry.kernels.rotations import turn


@njit(
    "float64(int64, int64, float64[::1], float64[:,::1], float64[:,::1], float64[:,::1], float64, float64[::1], float64[:,::1], float64[:,::1], float64[::1], float64[::1])",
    **OPTIONS,
)
def normal_equations(first, last, robust, X, xy, weight, c, X0, R, N, g, size):
    """Fill the normal equations of one image, its rays first ... last - 1; returns the sum of squares of v.

    Parameters
    ----------
    robust : (n,) float64
        Robust weight of each ray of the image, from 0.
    X : (n_rays, 3) float64, m
    xy, weight : (n_rays, 2) float64, mm and 1/mm
    c : float, mm
    X0, R : (3,), (3, 3) float64
    N, g : (6, 6), (6,) float64
        Filled in; of N the lower triangle.
    size : (n,) float64
        Filled in: root mean square of the two whitened residuals of each ray.
    """
    N[:, :] = 0.0
    g[:] = 0.0
    J, total = np.empty(6), 0.0
    for k in range(first, last):
        d0, d1, d2 = X[k, 0] - X0[0], X[k, 1] - X0[1], X[k, 2] - X0[2]
        u2 = R[0, 2] * d0 + R[1, 2] * d1 + R[2, 2] * d2
        f, square, p = -c / u2, 0.0, robust[k - first]
        for e in range(2):
            computed = f * (R[0, e] * d0 + R[1, e] * d1 + R[2, e] * d2)
            w = weight[k, e]
            v = (computed - xy[k, e]) * w
            a, b = f * w, -computed / u2 * w
            q0, q1, q2 = a * R[0, e] + b * R[0, 2], a * R[1, e] + b * R[1, 2], a * R[2, e] + b * R[2, 2]
            J[0], J[1], J[2] = -q0, -q1, -q2
            J[3], J[4], J[5] = q1 * d2 - q2 * d1, q2 * d0 - q0 * d2, q0 * d1 - q1 * d0
            square += v * v
            for i in range(6):
                h = p * J[i]
                g[i] += h * v
                for j in range(i + 1):
                    N[i, j] += h * J[j]
        total += square
        size[k - first] = np.sqrt(0.5 * square)
    return total


GROSS = 10.0
"""Residuals beyond so many times Huber's limit have no weight: near the camera even a bounded one moves it far."""


@njit("boolean(int64, float64, float64[::1], float64[::1], float64[::1])", **OPTIONS)
def reweight(n, huber, size, robust, work):
    """Huber weights by the image's own median spread, none of the grossest; returns whether one still changes."""
    for k in range(n):
        work[k] = size[k]
    limit, changed = huber * max(1.5 * select(work, n, n // 2), 1.0), False
    for k in range(n):
        weight = limit / size[k] if size[k] > limit else 1.0
        if size[k] > GROSS * limit:
            weight = 0.0
        if np.abs(weight - robust[k]) > 1e-3:
            changed = True
        robust[k] = weight
    return changed


@njit(
    "void(int64, int64, int64[::1], float64[:,::1], float64[:,::1], float64[:,::1], float64[::1], int64, float64, float64, int64, float64[:,::1], float64[:,:,::1], float64[:,:,::1], float64[::1], boolean[::1])",
    **OPTIONS,
)
def resect(first, last, start, X, xy, weight, c, fewest, huber, tolerance, max_iterations, X0, R, Q, spread, done):
    """Resect the images first ... last - 1.

    Parameters
    ----------
    start : (n_images + 1,) int64
        First ray of each image.
    X, xy, weight
        One row per ray, in the order of the images.
    c : (n_images,) float64, mm
    fewest : int
        Images with fewer rays are left alone.
    huber, tolerance, max_iterations
        Of the method.
    X0, R : (n_images, 3), (n_images, 3, 3) float64
        Start; adjusted.
    Q : (n_images, 6, 6) float64
    spread : (n_images,) float64
        Root mean square of v.
    done : (n_images,) bool
        Where True the image is resected; what else is written for the others is not to be used.
    """
    most = 0
    for i in range(first, last):
        most = max(most, start[i + 1] - start[i])
    robust, size, work = np.empty(most), np.empty(most), np.empty(most)
    N, W, g, dx = np.empty((6, 6)), np.empty((6, 6)), np.empty(6), np.empty(6)
    for i in range(first, last):
        n = start[i + 1] - start[i]
        if n < fewest:
            continue
        robust[:n] = 1.0
        normal_equations(start[i], start[i + 1], robust, X, xy, weight, c[i], X0[i], R[i], N, g, size)
        reweight(n, huber, size, robust, work)  # a point that is wrong close to the camera would move it at once
        for _ in range(max_iterations):
            total = normal_equations(start[i], start[i + 1], robust, X, xy, weight, c[i], X0[i], R[i], N, g, size)
            if not (np.isfinite(total) and inverse_root(N, W) > DETERMINED):
                break
            decrement = newton_step(W, g, dx)
            for k in range(3):
                X0[i, k] += dx[k]
            turn(dx[3], dx[4], dx[5], R[i])
            changed = reweight(n, huber, size, robust, work)
            if decrement <= tolerance and not changed:
                inverse(W, Q[i])
                spread[i] = np.sqrt(total / (2 * n))
                done[i] = True
                break
