"""Model points of pairs by intersection, compiled; the equations are those of `geometry.intersection`.

`pose` and `rays` are those of `sampson`.
"""

import numpy as np
from numba import njit

from aatri.adjustment.kernels.small import DETERMINED, OPTIONS, inverse, inverse_root

PARALLEL = 1e-12
"""Rays whose directions differ less, as the square of the sine, do not meet."""

STEPS = 2
"""Corrections of the image coordinates towards the common plane of the rays."""


@njit("void(float64[:,::1], float64[:,::1], int64, float64[:,::1])", **OPTIONS)
def correct(E, rays, n, u):
    """Fill the rows of u with both rays of a point, moved by the smallest weighted correction into a plane with b."""
    gradient = np.empty(4)
    for i in range(3):
        u[0, i], u[1, i] = rays[n, i], rays[n, 3 + i]
    for _ in range(STEPS):
        F, square = 0.0, 0.0
        for i in range(3):
            of_left = E[i, 0] * u[1, 0] + E[i, 1] * u[1, 1] + E[i, 2] * u[1, 2]
            F += u[0, i] * of_left
            if i < 2:
                gradient[i] = of_left
                gradient[2 + i] = E[0, i] * u[0, 0] + E[1, i] * u[0, 1] + E[2, i] * u[0, 2]
        for i in range(4):
            square += rays[n, 6 + i] * gradient[i] * gradient[i]
        for i in range(4):
            u[i // 2, i % 2] -= F / square * rays[n, 6 + i] * gradient[i]


@njit("void(float64[:,::1], float64[::1], float64[:,::1], int64, int64, float64[:,::1])", **OPTIONS)
def add_normal(axes, X, rays, n, side, N):
    """Add to N the normal matrix of the two image coordinates of X, seen from the origin along the columns of `axes`."""
    u, J = np.empty(3), np.empty(3)
    for k in range(3):
        u[k] = axes[0, k] * X[0] + axes[1, k] * X[1] + axes[2, k] * X[2]
    for e in range(2):
        for i in range(3):
            J[i] = rays[n, 3 * side + 2] / u[2] * (axes[i, e] - u[e] / u[2] * axes[i, 2])
            for j in range(i + 1):
                N[i, j] += J[i] * J[j] / rays[n, 6 + 2 * side + e]


@njit("void(int64, int64, int64[::1], boolean[::1], float64[:,:,::1], float64[:,::1], float64[:,::1])", **OPTIONS)
def intersect(first, last, start, chosen, pose, rays, model):
    """Intersect the points of the chosen pairs among first ... last - 1.

    Parameters
    ----------
    start : (n_pairs + 1,) int64
        First point of each pair.
    pose, rays : (n_pairs, 3, 4), (n, 10) float64
        See `sampson`.
    model : (n, 14) float64
        Filled in: coordinates (3), covariance (9), the two projection coefficients; NaN where the rays are parallel, the
        covariance also where the point is as good as infinitely far.
    """
    E, u, w, X = np.empty((3, 3)), np.empty((2, 3)), np.empty(3), np.empty(3)
    N, W, eye = np.empty((3, 3)), np.empty((3, 3)), np.zeros((3, 3))
    eye[0, 0], eye[1, 1], eye[2, 2] = 1.0, 1.0, 1.0
    for p in range(first, last):
        if not chosen[p]:
            continue
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            for column in range(3):
                E[i, column] = pose[p, j, column] * pose[p, k, 3] - pose[p, k, column] * pose[p, j, 3]
        for n in range(start[p], start[p + 1]):
            correct(E, rays, n, u)
            square, of_u, of_w, l1, l2 = 0.0, 0.0, 0.0, 0.0, 0.0
            for i in range(3):
                w[i] = pose[p, i, 0] * u[1, 0] + pose[p, i, 1] * u[1, 1] + pose[p, i, 2] * u[1, 2]
            for i in range(3):
                j, k = (i + 1) % 3, (i + 2) % 3
                c = u[0, j] * w[k] - u[0, k] * w[j]
                square, of_u, of_w = square + c * c, of_u + u[0, i] * u[0, i], of_w + w[i] * w[i]
                l1 += (pose[p, j, 3] * w[k] - pose[p, k, 3] * w[j]) * c
                l2 += (pose[p, j, 3] * u[0, k] - pose[p, k, 3] * u[0, j]) * c
            if not square > PARALLEL * of_u * of_w:
                square = np.nan
            model[n, 12], model[n, 13] = l1 / square, l2 / square
            for i in range(3):
                X[i] = 0.5 * (l1 / square * u[0, i] + pose[p, i, 3] + l2 / square * w[i])
                model[n, i] = X[i]
                for j in range(3):
                    N[i, j], W[i, j] = 0.0, pose[p, i, j]
            add_normal(eye, X, rays, n, 0, N)
            for i in range(3):
                X[i] -= pose[p, i, 3]
            add_normal(W, X, rays, n, 1, N)
            determined = inverse_root(N, W) > DETERMINED
            if determined:
                inverse(W, N)
            for i in range(9):
                model[n, 3 + i] = N[i // 3, i % 3] if determined else np.nan
