"""Covariances of eliminated blocks and of their rays, while the covariance of the front is in memory.

With the front's covariance S, C = sum B'A over the rays of a block, Z = L^-1 C, the block has
Q = L^-T (I + Z S Z') L^-1, and its covariance with the kept unknowns is -L^-T Z S. The adjusted value of a ray has

    A S A' + A Q_xy B' + (A Q_xy B')' + B Q B'
"""

from __future__ import annotations

import numpy as np
from numba import njit

from aatri.adjustment.kernels.eliminate import OPTIONS

_SIGNATURE = (
    "void(int64, int64, int64, int64[::1], float64[:,:,::1], float64[:,:,::1], int64[:,::1], float64[::1,:], "
    "float64[:,::1], float64[:,::1], float64[:,:,::1], float64[:,:,::1])"
)


@njit(_SIGNATURE, **OPTIONS)
def block_covariances(p0, p1, base, ray_start, A, B, row, S, free, Ls, Q, R):
    """Covariance of the blocks p0 ... p1 - 1 and of the adjusted values of their rays.

    Parameters
    ----------
    row : (n, columns of A) int64
        Row of the front of each column of A, -1 where it is held.
    S : (k, k) float64, column-major
    free : (n_blocks, 3) float64
    Ls : (n_blocks, 6) float64
    Q : (n_blocks, 3, 3) float64
        Filled in.
    R : (n_rays, m, m) float64
        Filled in: covariance of the adjusted, whitened value of each ray.
    """
    m, columns = A.shape[1], A.shape[2]
    G = np.empty((3, 3))
    for p in range(p0, p1):
        r0, r1 = ray_start[p] - base, ray_start[p + 1] - base
        k = (r1 - r0) * columns
        Z = np.zeros((3, k))
        place = np.empty(k, dtype=np.int64)
        L = Ls[p]
        for r in range(r0, r1):
            for a in range(columns):
                j = (r - r0) * columns + a
                place[j] = row[r, a]
                s0, s1, s2 = 0.0, 0.0, 0.0
                if place[j] >= 0:
                    for i in range(m):
                        s0 += A[r, i, a] * B[r, i, 0]
                        s1 += A[r, i, a] * B[r, i, 1]
                        s2 += A[r, i, a] * B[r, i, 2]
                z0 = s0 * free[p, 0] / L[0]
                z1 = (s1 * free[p, 1] - L[1] * z0) / L[3]
                Z[0, j], Z[1, j] = z0, z1
                Z[2, j] = (s2 * free[p, 2] - L[2] * z0 - L[4] * z1) / L[5]
        T = np.zeros((3, k))
        for j in range(k):
            pj = place[j]
            if pj < 0:
                continue
            t0, t1, t2 = 0.0, 0.0, 0.0
            for i in range(k):
                if place[i] >= 0:
                    s = S[place[i], pj]
                    t0 += Z[0, i] * s
                    t1 += Z[1, i] * s
                    t2 += Z[2, i] * s
            T[0, j], T[1, j], T[2, j] = t0, t1, t2
        inverse = np.zeros((3, 3))
        inverse[0, 0] = 1.0 / L[0]
        inverse[1, 0] = -L[1] / (L[0] * L[3])
        inverse[2, 0] = (L[1] * L[4] - L[2] * L[3]) / (L[0] * L[3] * L[5])
        inverse[1, 1] = 1.0 / L[3]
        inverse[2, 1] = -L[4] / (L[3] * L[5])
        inverse[2, 2] = 1.0 / L[5]
        for a in range(3):
            for b in range(3):
                s = 1.0 if a == b else 0.0
                for j in range(k):
                    s += T[a, j] * Z[b, j]
                G[a, b] = s
        Q[p] = inverse.T @ G @ inverse
        for a in range(3):
            for b in range(3):
                Q[p, a, b] *= free[p, a] * free[p, b]
        cross = inverse.T @ T  # minus the covariance of the block with the kept unknowns
        for r in range(r0, r1):
            f = (r - r0) * columns
            for i in range(m):
                for j in range(m):
                    s = 0.0
                    for a in range(columns):
                        pa = place[f + a]
                        if pa < 0:
                            continue
                        for b in range(columns):
                            if place[f + b] >= 0:
                                s += A[r, i, a] * S[pa, place[f + b]] * A[r, j, b]
                        for b in range(3):
                            s -= A[r, i, a] * cross[b, f + a] * free[p, b] * B[r, j, b]
                            s -= A[r, j, a] * cross[b, f + a] * free[p, b] * B[r, i, b]
                    for a in range(3):
                        for b in range(3):
                            s += B[r, i, a] * Q[p, a, b] * B[r, j, b]
                    R[ray_start[p] + r - r0, i, j] = s
