"""Covariances of eliminated blocks and of their rays, while the covariance of the front is in memory.

With the front's covariance S, C = sum B'A over the rays of a block, Z = L^-1 C, the block has
Q = L^-T (I + Z S Z') L^-1, and its covariance with the kept unknowns is -L^-T Z S. The adjusted value of a ray has

    A S A' + A Q_xy B' + (A Q_xy B')' + B Q B'

This is the general form; `covariance_sized` is the same for rays of one part.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from aatri.adjustment.kernels.eliminate import OPTIONS

_SIGNATURE = (
    "void(int64, int64, int64, int64[::1], boolean[::1], float64[:,:,::1], float64[:,:,::1], int64[:,::1], float64[::1,:], "
    "float64[:,::1], float64[:,::1], float64[:,:,::1], float64[:,:,::1], float64[:,:,::1])"
)


@njit("void(int64, float64[:,::1], float64[:,::1], float64[:,::1], float64[:,::1], float64[:,:,::1])", **OPTIONS)
def from_factor(p, Ls, G, free, inverse, Q):
    """Covariance of block p, L^-T G L^-1, written into Q; L^-1 into `inverse`."""
    l00, l10, l20, l11, l21, l22 = Ls[p, 0], Ls[p, 1], Ls[p, 2], Ls[p, 3], Ls[p, 4], Ls[p, 5]
    inverse[0, 0] = 1.0 / l00
    inverse[1, 0] = -l10 / (l00 * l11)
    inverse[2, 0] = (l10 * l21 - l20 * l11) / (l00 * l11 * l22)
    inverse[1, 1] = 1.0 / l11
    inverse[2, 1] = -l21 / (l11 * l22)
    inverse[2, 2] = 1.0 / l22
    for a in range(3):
        for b in range(3):
            s = 0.0
            for i in range(a, 3):
                for j in range(b, 3):
                    s += inverse[i, a] * G[i, j] * inverse[j, b]
            Q[p, a, b] = s * free[p, a] * free[p, b]


@njit(_SIGNATURE, **OPTIONS)
def block_covariances(p0, p1, base, ray_start, active, A, B, row, S, free, Ls, Q, R, X):
    """Covariance of the blocks p0 ... p1 - 1 and of the adjusted values of their rays.

    Parameters
    ----------
    active : (n,) bool
        Others are predicted: they are no part of C.
    row : (n, columns of A) int64
        Row of the front of each column of A, -1 where it is held.
    S : (k, k) float64, column-major
    free : (n_blocks, 3) float64
    Ls : (n_blocks, 6) float64
    Q : (n_blocks, 3, 3) float64
        Filled in.
    R : (n_rays, m, m) float64
        Filled in: covariance of the adjusted, whitened value of each ray.
    X : (n, columns of A, 3) float64, or without rows
        Filled in: minus the covariance of the kept unknowns of each ray with its block.
    """
    m, columns = A.shape[1], A.shape[2]
    most = 0
    for p in range(p0, p1):
        most = max(most, (ray_start[p + 1] - ray_start[p]) * columns)
    Z, T, place = np.empty((most, 3)), np.empty((most, 3)), np.empty(most, dtype=np.int64)
    G, inverse, cross, half = np.empty((3, 3)), np.zeros((3, 3)), np.empty((columns, 3)), np.empty(columns)
    for p in range(p0, p1):
        r0, r1 = ray_start[p] - base, ray_start[p + 1] - base
        L = Ls[p]
        k = 0
        for r in range(r0, r1):
            for a in range(columns):
                s0, s1, s2 = 0.0, 0.0, 0.0
                place[k] = row[r, a]
                if active[r] and row[r, a] >= 0:
                    for i in range(m):
                        s0 += A[r, i, a] * B[r, i, 0]
                        s1 += A[r, i, a] * B[r, i, 1]
                        s2 += A[r, i, a] * B[r, i, 2]
                z0 = s0 * free[p, 0] / L[0]
                z1 = (s1 * free[p, 1] - L[1] * z0) / L[3]
                Z[k, 0], Z[k, 1] = z0, z1
                Z[k, 2] = (s2 * free[p, 2] - L[2] * z0 - L[4] * z1) / L[5]
                k += 1
        for a in range(3):
            for b in range(3):
                G[a, b] = 1.0 if a == b else 0.0
        for j in range(k):
            t0, t1, t2, pj = 0.0, 0.0, 0.0, place[j]
            if pj >= 0:
                for i in range(k):
                    if place[i] >= 0:
                        s = S[place[i], pj]
                        t0 += Z[i, 0] * s
                        t1 += Z[i, 1] * s
                        t2 += Z[i, 2] * s
            T[j, 0], T[j, 1], T[j, 2] = t0, t1, t2
            for b in range(3):
                G[0, b] += t0 * Z[j, b]
                G[1, b] += t1 * Z[j, b]
                G[2, b] += t2 * Z[j, b]
        from_factor(p, Ls, G, free, inverse, Q)
        for r in range(r0, r1):
            f = (r - r0) * columns
            for a in range(columns):  # minus the covariance of the block with the kept unknowns
                for b in range(3):
                    s = 0.0
                    for i in range(b, 3):
                        s += inverse[i, b] * T[f + a, i]
                    cross[a, b] = s * free[p, b]
                    if len(X):
                        X[r, a, b] = cross[a, b]
            for i in range(m):
                for b in range(columns):
                    s = 0.0
                    if place[f + b] >= 0:
                        for a in range(columns):
                            if place[f + a] >= 0:
                                s += A[r, i, a] * S[place[f + a], place[f + b]]
                    half[b] = s
                for j in range(m):
                    s = 0.0
                    for b in range(columns):
                        if place[f + b] >= 0:
                            s += half[b] * A[r, j, b]
                            for e in range(3):
                                s -= cross[b, e] * (A[r, i, b] * B[r, j, e] + A[r, j, b] * B[r, i, e])
                    for a in range(3):
                        for b in range(3):
                            s += B[r, i, a] * Q[p, a, b] * B[r, j, b]
                    R[ray_start[p] + r - r0, i, j] = s


@njit("float64[::1,:](float64[::1,:], int32[::1])", nogil=True, cache=True)
def part_of(S, row):
    """Rows and columns `row` of a matrix, column-major."""
    n = len(row)
    part = np.empty((n, n)).T
    for j in range(n):
        for i in range(n):
            part[i, j] = S[row[i], row[j]]
    return part
