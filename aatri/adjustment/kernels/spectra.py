"""Covariances V diag(l) V' of many points, kept as eigenvalues l and eigenvectors V by columns, compiled.

They come from cyclic Jacobi rotations. Source: Golub & Van Loan, Matrix Computations, 8.5.
"""

import numpy as np
from numba import njit

from aatri.adjustment.kernels.small import OPTIONS

SWEEPS = 30
"""More than ever needed: convergence is quadratic, after some four."""

_MANY = "float64[:,::1], float64[:,:,::1]"


@njit("void(int64, int64, float64[:,:,::1], float64[:,::1], float64[:,:,::1])", **OPTIONS)
def eigen(first, last, matrix, values, vectors):
    """Fill in eigenvalues (n, 3), in no order, and eigenvectors by columns (n, 3, 3) of the matrices first ... last - 1.

    Only the lower triangles are read. NaN stays NaN.
    """
    a, V = np.empty((3, 3)), np.empty((3, 3))
    for r in range(first, last):
        for i in range(3):
            for j in range(3):
                a[i, j] = matrix[r, max(i, j), min(i, j)]
                V[i, j] = 1.0 if i == j else 0.0
        for _ in range(SWEEPS):
            done = True
            for p in range(2):
                for q in range(p + 1, 3):
                    # What is this small does not change the product of the two diagonal elements.
                    if a[p, q] * a[p, q] <= 1e-34 * abs(a[p, p] * a[q, q]):
                        continue
                    done = False
                    theta = (a[q, q] - a[p, p]) / (2.0 * a[p, q])
                    t = (1.0 if theta >= 0.0 else -1.0) / (abs(theta) + np.sqrt(theta * theta + 1.0))
                    c = 1.0 / np.sqrt(t * t + 1.0)
                    s = t * c
                    a[p, p] -= t * a[p, q]
                    a[q, q] += t * a[p, q]
                    a[p, q], a[q, p] = 0.0, 0.0
                    o = 3 - p - q
                    x, y = a[o, p], a[o, q]
                    a[o, p], a[o, q] = c * x - s * y, s * x + c * y
                    a[p, o], a[q, o] = a[o, p], a[o, q]
                    for i in range(3):
                        x, y = V[i, p], V[i, q]
                        V[i, p], V[i, q] = c * x - s * y, s * x + c * y
            if done:
                break
        for i in range(3):
            values[r, i] = a[i, i]
            for j in range(3):
                vectors[r, i, j] = V[i, j]


@njit(f"boolean(int64, int64, {_MANY}, {_MANY}, float64, float64)", **OPTIONS)
def is_steady(first, last, l_before, V_before, l_after, V_after, added, share):
    """Whether none of the covariances first ... last - 1, `added` to all eigenvalues, changes by more than a share of
    its norm.

    Parameters
    ----------
    l_before, l_after : (n, 3) float64
    V_before, V_after : (n, 3, 3) float64
        By columns.
    """
    for r in range(first, last):
        off, size = 0.0, 0.0
        for i in range(3):
            for j in range(i + 1):
                before, after = 0.0, 0.0
                for k in range(3):
                    before += V_before[r, i, k] * (l_before[r, k] + added) * V_before[r, j, k]
                    after += V_after[r, i, k] * (l_after[r, k] + added) * V_after[r, j, k]
                times = 1.0 if i == j else 2.0
                off += times * (after - before) ** 2
                size += times * before**2
        if not np.sqrt(off) <= share * np.sqrt(size):
            return False
    return True


@njit(f"void(int64, int64, int32[::1], float64[::1], float64[:,:,::1], {_MANY}, {_MANY})", nogil=True, cache=True)
def turn(first, last, body, scale, R, values, vectors, turned_values, turned_vectors):
    """Fill in the eigenvalues s^2 l and eigenvectors R V of points first ... last - 1 after a similarity of their body.

    Parameters
    ----------
    body : (n,) int32
    scale, R : (n_bodies,), (n_bodies, 3, 3) float64
    values, vectors : (n, 3), (n, 3, 3) float64
    """
    for r in range(first, last):
        b = body[r]
        for i in range(3):
            turned_values[r, i] = scale[b] * scale[b] * values[r, i]
            for j in range(3):
                turned = R[b, i, 0] * vectors[r, 0, j] + R[b, i, 1] * vectors[r, 1, j]
                turned_vectors[r, i, j] = turned + R[b, i, 2] * vectors[r, 2, j]
