"""Weighted means of points over the models of a strip, compiled, one point after the other."""

import numpy as np
from numba import njit

from aatri.adjustment.kernels.small import OPTIONS, inverse, inverse_root


@njit(
    "void(int64, int64, int64[::1], int64[::1], int64[::1], float64[::1], float64[:,:,::1], float64[:,:,::1], float64[:,::1], float64[:,::1], float64[:,:,::1])",
    **OPTIONS,
)
def means(begin, end, start, rows, model, scale, rotation, covariance, x, mean, found):
    """Fill the means of the points begin ... end - 1 and their covariances; NaN where a covariance is not definite.

    Parameters
    ----------
    start : (n_points + 1,) int64
        First of the rows of each point.
    rows : (n,) int64
        Rows of the model points.
    model : (p,) int64
        The model of each row.
    scale, rotation : (m,), (m, 3, 3) float64
        Of each model in its strip.
    covariance : (p, 3, 3) float64
        In the models.
    x : (p, 3) float64
        In the strips.
    mean, found : (n_points, 3), (n_points, 3, 3) float64
    """
    C, N, T = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    W, Q, moment = np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    for g in range(begin, end):
        first, sound = rows[start[g]], True
        N[:] = 0.0
        moment[:] = 0.0
        for row in rows[start[g] : start[g + 1]]:
            k = model[row]
            R, square = rotation[k], scale[k] * scale[k]
            for i in range(3):
                for j in range(3):
                    s = 0.0
                    for n in range(3):
                        s += R[i, n] * covariance[row, n, j]
                    T[i, j] = square * s
            for i in range(3):
                for j in range(i + 1):
                    s = 0.0
                    for n in range(3):
                        s += T[i, n] * R[j, n]
                    C[i, j] = s
            sound = inverse_root(C, W) > 0.0 and sound
            inverse(W, Q)
            for i in range(3):
                for j in range(3):
                    N[i, j] += Q[i, j]
                    moment[i] += Q[i, j] * (x[row, j] - x[first, j])
        sound = inverse_root(N, W) > 0.0 and sound
        inverse(W, Q)
        for i in range(3):
            s = 0.0
            for j in range(3):
                found[g, i, j] = Q[i, j] if sound else np.nan
                s += Q[i, j] * moment[j]
            mean[g, i] = x[first, i] + s if sound else np.nan
