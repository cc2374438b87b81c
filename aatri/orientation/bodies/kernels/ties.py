"""Whitened residuals and Jacobians of the points of strips, compiled; see `similarity_ties`.

With the whitener T of a point, v = T (X - x_o), and the derivatives are T by the ground point and -T dx_o by the strip.
"""

import numpy as np
from numba import njit

from aatri.adjustment.kernels.small import OPTIONS

_COMMON = "int64, int64, int32[::1], int32[::1], float64[:,:,::1], float64[:,::1], float64[:,::1]"
_FILLED = "float64[:,::1], float64[:,:,::1], float64[:,:,::1]"


@njit(f"void({_COMMON}, float64[:,::1], float64[:,:,::1], float64[:,::1], {_FILLED})", **OPTIONS)
def polynomial(first, last, strip, point, T, X, x, p, G, coefficients, v, A, B):
    """Ties by polynomials: x + G (a'p, b'p, c'p).

    Parameters
    ----------
    strip, point : (n,) int32
    T : (n, 3, 3) float64
    X : (n_points, 3) float64
        Ground points.
    x : (n, 3) float64
        Points of the strips.
    p : (n, 5) float64
    G : (n_strips, 3, 3) float64
    coefficients : (n_strips, 15) float64
    v, A, B : (m, 3), (m, 3, 15), (m, 3, 3) float64
        Filled in for the records first ... last - 1.
    """
    d, c = np.empty(3), np.empty(3)
    for r in range(first, last):
        k, q, i = strip[r], point[r], r - first
        for axis in range(3):
            s = 0.0
            for t in range(5):
                s += coefficients[k, 5 * axis + t] * p[r, t]
            c[axis] = s
        for a in range(3):
            d[a] = X[q, a] - x[r, a] - (G[k, a, 0] * c[0] + G[k, a, 1] * c[1] + G[k, a, 2] * c[2])
        for a in range(3):
            v[i, a] = T[r, a, 0] * d[0] + T[r, a, 1] * d[1] + T[r, a, 2] * d[2]
            for axis in range(3):
                turned = T[r, a, 0] * G[k, 0, axis] + T[r, a, 1] * G[k, 1, axis] + T[r, a, 2] * G[k, 2, axis]
                for t in range(5):
                    A[i, a, 5 * axis + t] = -turned * p[r, t]
                B[i, a, axis] = T[r, a, axis]


@njit(
    f"void({_COMMON}, float64[:,::1], float64[::1], float64[:,:,::1], {_FILLED})",
    **OPTIONS,
)
def similarity(first, last, strip, point, T, X, x, shift, scale, R, v, A, B):
    """Ties by similarities: shift + scale R x."""
    d, arm = np.empty(3), np.empty(3)
    for r in range(first, last):
        k, q, i = strip[r], point[r], r - first
        for a in range(3):
            s = 0.0
            for e in range(3):
                s += R[k, a, e] * x[r, e]
            arm[a] = scale[k] * s
            d[a] = X[q, a] - (shift[k, a] + arm[a])
        for a in range(3):
            t0, t1, t2 = T[r, a, 0], T[r, a, 1], T[r, a, 2]
            v[i, a] = t0 * d[0] + t1 * d[1] + t2 * d[2]
            A[i, a, 0], A[i, a, 1], A[i, a, 2] = -t0, -t1, -t2
            A[i, a, 3] = t1 * arm[2] - t2 * arm[1]
            A[i, a, 4] = t2 * arm[0] - t0 * arm[2]
            A[i, a, 5] = t0 * arm[1] - t1 * arm[0]
            A[i, a, 6] = -(t0 * arm[0] + t1 * arm[1] + t2 * arm[2])
            B[i, a, 0], B[i, a, 1], B[i, a, 2] = t0, t1, t2
