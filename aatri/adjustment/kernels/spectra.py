"""Covariances V diag(l) V' of many points, kept as eigenvalues l and eigenvectors V, compiled."""

import numpy as np
from numba import njit

from aatri.adjustment.kernels.small import OPTIONS

_MANY = "float64[:,::1], float64[:,:,::1]"


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
