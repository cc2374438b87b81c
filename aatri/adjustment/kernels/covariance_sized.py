"""Covariances of blocks met by rays of one part, and of their rays, a group of blocks at a time, for any pair of sizes.

The method is that of `covariance`, the groups are those of `eliminate_pose`: the part S of the front's covariance that a
group meets is gathered once, and one product S Z serves all its blocks. Both sizes are constants of the compiled code;
see `eliminate_sized`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numba import njit

from aatri.adjustment.kernels.covariance import from_factor
from aatri.adjustment.kernels.eliminate import MOST_RAYS, OPTIONS
from aatri.adjustment.kernels.eliminate_pose import group_of
from aatri.adjustment.kernels.eliminate_sized import UNROLLED

_SIGNATURE = (
    "void(int64, int64, int64, int64[::1], boolean[::1], float64[:,:,::1], float64[:,:,::1], int32[:,::1], float64[::1,:], "
    "float64[:,::1], float64[:,::1], float64[:,:,::1], float64[:,:,::1], float64[:,:,::1])"
)


def covariances(m: int, k: int) -> Callable[..., Any]:
    """The compiled function for m residuals and k kept unknowns a ray; its parameters are

    Parameters
    ----------
    p0, p1 : int
        Covariances of the blocks p0 ... p1 - 1 and of the adjusted values of their rays.
    base : int
        Number of the ray in row 0 of A, B and loc.
    ray_start : (n_blocks + 1,) int64
    active : (n,) bool
        Others are predicted.
    A, B : (n, m, k), (n, m, 3) float64
        Zero for unknowns that are held.
    loc : (n, 1) int32
    S : (columns, columns) float64, column-major
        Covariance of the front.
    free, Ls : (n_blocks, 3), (n_blocks, 6) float64
    Q : (n_blocks, 3, 3) float64
        Filled in.
    R : (n_rays, m, m) float64
        Filled in.
    X : (n, k, 3) float64, or without rows
        Filled in: minus the covariance of the part's unknowns with the block.
    """
    return _covariances(m, k) if k <= UNROLLED else _covariances(0, 0)


@cache
def _covariances(of_m: int, of_k: int) -> Callable[..., Any]:
    """The function for a pair of sizes; for zeros that of any sizes."""

    @njit(_SIGNATURE, **OPTIONS)
    def sized_covariances(p0, p1, base, ray_start, active, A, B, loc, S, free, Ls, Q, R, X):
        m = of_m if of_m else A.shape[1]
        k = of_k if of_k else A.shape[2]
        at, spare = np.empty(3 * MOST_RAYS, dtype=np.int64), np.empty(3 * MOST_RAYS, dtype=np.int64)
        gathered, stacked, product = np.empty(0), np.empty(0), np.empty(0)
        G, inverse, cross = np.empty((3, 3)), np.zeros((3, 3)), np.zeros((k, 3))
        half, W = np.empty((m, k)), np.empty((m, 3))
        p = p0
        while p < p1:
            end, n = group_of(p, p1, base, ray_start, loc, at, spare)
            rows, columns = k * n, 3 * (end - p)
            if rows * rows > len(gathered):
                gathered = np.empty(2 * rows * rows)
            if rows * columns > len(stacked):
                stacked, product = np.empty(2 * rows * columns), np.empty(2 * rows * columns)
            part = gathered[: rows * rows].reshape((rows, rows))
            Z = stacked[: rows * columns].reshape((rows, columns))
            T = product[: rows * columns].reshape((rows, columns))
            for q in range(n):
                for b in range(k):
                    for other in range(n):
                        for a in range(k):
                            part[k * q + b, k * other + a] = S[at[other] + a, at[q] + b]
            Z[:] = 0.0
            for block in range(p, end):  # Z = L^-1 B'A, transposed
                j, q = 3 * (block - p), 0
                i0, i1, i2 = 1.0 / Ls[block, 0], 1.0 / Ls[block, 3], 1.0 / Ls[block, 5]
                f0, f1, f2 = free[block, 0] * i0, free[block, 1], free[block, 2]
                l1, l2, l4 = Ls[block, 1], Ls[block, 2], Ls[block, 4]
                for r in range(ray_start[block] - base, ray_start[block + 1] - base):
                    c = np.int64(loc[r, 0])
                    if c < 0 or not active[r]:
                        continue
                    while at[q] < c:
                        q += 1
                    for i in range(m):
                        u0 = B[r, i, 0] * f0
                        u1 = (B[r, i, 1] * f1 - l1 * u0) * i1
                        u2 = (B[r, i, 2] * f2 - l2 * u0 - l4 * u1) * i2
                        for a in range(k):
                            x, y, z, w = Z[k * q + a, j], Z[k * q + a, j + 1], Z[k * q + a, j + 2], A[r, i, a]
                            Z[k * q + a, j] = x + w * u0
                            Z[k * q + a, j + 1] = y + w * u1
                            Z[k * q + a, j + 2] = z + w * u2
            if n:
                np.dot(part, Z, T)
            for block in range(p, end):
                j, q = 3 * (block - p), 0
                g00, g10, g11, g20, g21, g22 = 1.0, 0.0, 1.0, 0.0, 0.0, 1.0  # symmetric, as the part is
                for i in range(rows):
                    x, y, z = Z[i, j], Z[i, j + 1], Z[i, j + 2]
                    g00 += T[i, j] * x
                    g10 += T[i, j + 1] * x
                    g11 += T[i, j + 1] * y
                    g20 += T[i, j + 2] * x
                    g21 += T[i, j + 2] * y
                    g22 += T[i, j + 2] * z
                G[0, 0], G[1, 0], G[2, 0], G[0, 1], G[1, 1], G[2, 1] = g00, g10, g20, g10, g11, g21
                G[0, 2], G[1, 2], G[2, 2] = g20, g21, g22
                from_factor(block, Ls, G, free, inverse, Q)
                f0, f1, f2 = free[block, 0], free[block, 1], free[block, 2]
                i00, i10, i20, i11 = inverse[0, 0] * f0, inverse[1, 0] * f0, inverse[2, 0] * f0, inverse[1, 1] * f1
                i21, i22 = inverse[2, 1] * f1, inverse[2, 2] * f2
                for r in range(ray_start[block] - base, ray_start[block + 1] - base):
                    c = np.int64(loc[r, 0])
                    for i in range(m):
                        for b in range(3):
                            W[i, b] = 0.5 * (
                                Q[block, b, 0] * B[r, i, 0] + Q[block, b, 1] * B[r, i, 1] + Q[block, b, 2] * B[r, i, 2]
                            )
                    if c >= 0:
                        while at[q] < c:
                            q += 1
                        o = k * q
                        for a in range(k):  # minus the covariance of the part's unknowns with the block
                            t0, t1, t2 = T[o + a, j], T[o + a, j + 1], T[o + a, j + 2]
                            cross[a, 0] = i00 * t0 + i10 * t1 + i20 * t2
                            cross[a, 1] = i11 * t1 + i21 * t2
                            cross[a, 2] = i22 * t2
                        for i in range(m):
                            w0, w1, w2 = W[i, 0], W[i, 1], W[i, 2]
                            for a in range(k):
                                s = 0.0
                                for b in range(k):
                                    s += part[o + a, o + b] * A[r, i, b]
                                half[i, a] = s
                                w0 -= A[r, i, a] * cross[a, 0]
                                w1 -= A[r, i, a] * cross[a, 1]
                                w2 -= A[r, i, a] * cross[a, 2]
                            W[i, 0], W[i, 1], W[i, 2] = w0, w1, w2
                    if len(X):
                        for a in range(k):
                            for b in range(3):
                                X[r, a, b] = cross[a, b] if c >= 0 else 0.0
                    for i in range(m):
                        for e in range(i + 1):
                            s = W[i, 0] * B[r, e, 0] + W[i, 1] * B[r, e, 1] + W[i, 2] * B[r, e, 2]
                            s += W[e, 0] * B[r, i, 0] + W[e, 1] * B[r, i, 1] + W[e, 2] * B[r, i, 2]
                            if c >= 0:
                                for a in range(k):
                                    s += half[i, a] * A[r, e, a]
                            R[base + r, i, e] = s
                            R[base + r, e, i] = s
            p = end

    found: Callable[..., Any] = sized_covariances
    return found


for sizes in ((2, 6), (3, 7), (0, 0)):
    _covariances(*sizes)
