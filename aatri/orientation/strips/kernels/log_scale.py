"""Observation equations of the scale between two models, compiled: l = log r_a - log r_b of their common points.

r_a is the distance from the right projection centre of the first model, r_b that from the left one of the second, of
the same image. A turn of a ray in its plane with the base changes log r by cot and 1 / sin of the angle g at the point;
the ray of the common image changes both distances, so that they are correlated. See `strips.joints`.
"""

import numpy as np
from numba import njit

from aatri.adjustment.kernels.small import OPTIONS


@njit("UniTuple(float64, 3)(float64, float64, float64, float64, float64, float64)", **OPTIONS)
def cross(a, b, c, x, y, z):
    return b * z - c * y, c * x - a * z, a * y - b * x


@njit("void(float64[::1], float64[:,::1])", **OPTIONS)
def tangents(b, T):
    """Fill T (2, 3) with the directions of `vectors.tangents`."""
    main = 0
    for i in range(1, 3):
        if abs(b[i]) > abs(b[main]):
            main = i
    f = (main + 1) % 3
    for i in range(3):
        T[0, i] = (1.0 if i == f else 0.0) - b[i] * b[f]
    length = np.sqrt(T[0, 0] ** 2 + T[0, 1] ** 2 + T[0, 2] ** 2)
    for i in range(3):
        T[0, i] /= length
    T[1, 0], T[1, 1], T[1, 2] = cross(b[0], b[1], b[2], T[0, 0], T[0, 1], T[0, 2])
    for i in range(3):
        T[1, i] *= np.sign(b[main])


@njit("void(float64[::1], float64[::1], float64[:,::1], boolean, float64[::1])", **OPTIONS)
def of_orientation(X, b, T, right, d):
    """Fill d (5,) with the derivatives of the logarithm of a distance by the errors of the model's own orientation.

    Parameters
    ----------
    right : bool
        From the right projection centre, else from the left one.
    """
    w0, w1, w2 = X[0] - b[0], X[1] - b[1], X[2] - b[2]
    n0, n1, n2 = cross(X[0], X[1], X[2], w0, w1, w2)
    a0, a1, a2 = cross(n0, n1, n2, w0, w1, w2)
    length = np.sqrt(X[0] ** 2 + X[1] ** 2 + X[2] ** 2)
    u0, u1, u2 = X[0] / length, X[1] / length, X[2] / length
    d[0], d[1], d[2] = cross(w0, w1, w2, a0, a1, a2)
    d[3] = a0 * T[0, 0] + a1 * T[0, 1] + a2 * T[0, 2]
    d[4] = a0 * T[1, 0] + a1 * T[1, 1] + a2 * T[1, 2]
    factor = 1.0 / (a0 * u0 + a1 * u1 + a2 * u2)
    if not right:
        for i in range(5):
            d[i] *= factor / length
        return
    square = w0 * w0 + w1 * w1 + w2 * w2
    factor *= (w0 * u0 + w1 * u1 + w2 * u2) / square
    for i in range(5):
        d[i] *= factor
    for i in range(2):
        d[3 + i] -= (w0 * T[i, 0] + w1 * T[i, 1] + w2 * T[i, 2]) / square


@njit("UniTuple(float64, 4)(float64, float64, float64, float64, float64, float64, float64[:,::1])", **OPTIONS)
def of_ray(r0, r1, r2, o0, o1, o2, covariance):
    """Variance of log |r| from the image coordinates; its change by a turn of the ray r and of the other ray o; |r|."""
    square = r0 * r0 + r1 * r1 + r2 * r2
    s = 0.0
    for i in range(3):
        row = covariance[i, 0] * r0 + covariance[i, 1] * r1 + covariance[i, 2] * r2
        s += row * (r0 if i == 0 else (r1 if i == 1 else r2))
    x, y, z = cross(r0, r1, r2, o0, o1, o2)
    sine = np.sqrt(x * x + y * y + z * z)
    own, other = (r0 * o0 + r1 * o1 + r2 * o2) / sine, (o0 * o0 + o1 * o1 + o2 * o2) / sine
    return s / square**2, own, other, np.sqrt(square)


@njit("UniTuple(float64, 3)(float64, float64, float64, float64, float64, float64)", **OPTIONS)
def across(b0, b1, b2, r0, r1, r2):
    """Direction in which a turn of the ray opens its angle with the base."""
    share = (b0 * r0 + b1 * r1 + b2 * r2) / (r0 * r0 + r1 * r1 + r2 * r2)
    x, y, z = r0 * share - b0, r1 * share - b1, r2 * share - b2
    length = np.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


@njit(
    "void(int64, int64, int64[::1], int64[::1], int64[::1], float64[:,::1], float64[:,:,::1], float64[:,::1], float64[:,:,::1], float64[:,:,::1], float64[::1], float64[::1], float64[:,::1])",
    **OPTIONS,
)
def log_scales(begin, end, first, second, of_row, xyz, covariance, base, left_from_right, roots, observed, sigma, A):
    """Fill observations, standard deviations and whitened derivatives of the common points begin ... end - 1.

    Parameters
    ----------
    first, second : (n,) int64
        Rows of the common points among those of the models.
    of_row : (p,) int64
        The model of each row.
    xyz, covariance : (p, 3), (p, 3, 3) float64
    base, left_from_right, roots : (m, 3), (m, 3, 3), (m, 5, 5) float64
        Of the models; a root of the covariance of each orientation.
    observed, sigma : (n,) float64
    A : (n, 11) float64
    """
    T, d = np.empty((2, 3)), np.empty(5)
    for k in range(begin, end):
        i, j = first[k], second[k]
        p, q = of_row[i], of_row[j]
        X, Y, b, c, R = xyz[i], xyz[j], base[p], base[q], left_from_right[p]
        w0, w1, w2 = X[0] - b[0], X[1] - b[1], X[2] - b[2]
        variance_a, slope_a, other_a, length_a = of_ray(w0, w1, w2, X[0], X[1], X[2], covariance[i])
        variance_b, slope_b, other_b, length_b = of_ray(
            Y[0], Y[1], Y[2], Y[0] - c[0], Y[1] - c[1], Y[2] - c[2], covariance[j]
        )
        x, y, z = across(-b[0], -b[1], -b[2], w0, w1, w2)
        f, g, h = across(c[0], c[1], c[2], Y[0], Y[1], Y[2])
        cosine = (x * R[0, 0] + y * R[1, 0] + z * R[2, 0]) * f
        cosine += (x * R[0, 1] + y * R[1, 1] + z * R[2, 1]) * g
        cosine += (x * R[0, 2] + y * R[1, 2] + z * R[2, 2]) * h
        angle_a = variance_a / (slope_a * slope_a + other_a * other_a)
        angle_b = variance_b / (slope_b * slope_b + other_b * other_b)
        both = slope_a * slope_b * cosine * np.sqrt(angle_a * angle_b)
        observed[k] = np.log(length_a / length_b)
        sigma[k] = np.sqrt(variance_a + variance_b - 2.0 * both)
        for side in range(2):
            row, m = (i, p) if side == 0 else (j, q)
            tangents(base[m], T)
            of_orientation(xyz[row], base[m], T, side == 0, d)
            for u in range(5):
                s = 0.0
                for n in range(5):
                    s += d[n] * roots[m, n, u]
                A[k, 5 * side + u] = s / sigma[k]
        A[k, 10] = 1.0 / sigma[k]
