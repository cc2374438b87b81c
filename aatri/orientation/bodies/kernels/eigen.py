"""Eigenvalues and eigenvectors of many symmetric 3x3 matrices, compiled: cyclic Jacobi rotations.

Source: Golub & Van Loan, Matrix Computations, 8.5.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from aatri.adjustment.kernels.small import OPTIONS

SWEEPS = 30
"""More than ever needed: convergence is quadratic, after some four."""


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
