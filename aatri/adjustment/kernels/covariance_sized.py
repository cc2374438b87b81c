"""Covariances of blocks met by rays of one part, and of their rays, a group at a time, for any pair of sizes.

The method is that of `covariance_pose`, for m residuals and one part of k unknowns a ray; see `eliminate_sized`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numba import njit

from aatri.adjustment.kernels.covariance import from_factor
from aatri.adjustment.kernels.covariance_pose import POSE, pose_covariances
from aatri.adjustment.kernels.eliminate import MOST_RAYS, OPTIONS
from aatri.adjustment.kernels.eliminate_pose import group_of


@cache
def covariances(m: int, k: int) -> Callable[..., Any]:
    """`pose_covariances` for m residuals and k kept unknowns a ray, with the same parameters; itself for 2 and 6."""
    if (m, k) == (2, 6):
        return pose_covariances

    @njit(POSE, **OPTIONS)
    def sized_covariances(p0, p1, base, ray_start, active, A, B, loc, S, free, Ls, Q, R, X):
        at, spare = np.empty(3 * MOST_RAYS, dtype=np.int64), np.empty(3 * MOST_RAYS, dtype=np.int64)
        gathered, stacked, product = np.empty(0), np.empty(0), np.empty(0)
        G, inverse, cross, half = np.empty((3, 3)), np.zeros((3, 3)), np.empty((k, 3)), np.empty((m, k))
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
                            Z[k * q + a, j] += A[r, i, a] * u0
                            Z[k * q + a, j + 1] += A[r, i, a] * u1
                            Z[k * q + a, j + 2] += A[r, i, a] * u2
            if n:
                np.dot(part, Z, T)
            for block in range(p, end):
                j, q = 3 * (block - p), 0
                for a in range(3):
                    for b in range(3):
                        s = 1.0 if a == b else 0.0
                        for i in range(rows):
                            s += T[i, j + a] * Z[i, j + b]
                        G[a, b] = s
                from_factor(block, Ls, G, free, inverse, Q)
                for r in range(ray_start[block] - base, ray_start[block + 1] - base):
                    c, known = np.int64(loc[r, 0]), loc[r, 0] >= 0
                    while known and at[q] < c:
                        q += 1
                    o = k * q
                    for a in range(k):  # minus the covariance of the part's unknowns with the block
                        for b in range(3):
                            s = 0.0
                            if known:
                                for i in range(b, 3):
                                    s += inverse[i, b] * T[o + a, j + i]
                            cross[a, b] = s * free[block, b]
                            if len(X):
                                X[r, a, b] = cross[a, b]
                    for i in range(m):
                        for a in range(k):
                            s = 0.0
                            if known:
                                for b in range(k):
                                    s += part[o + a, o + b] * A[r, i, b]
                            half[i, a] = (
                                s - cross[a, 0] * B[r, i, 0] - cross[a, 1] * B[r, i, 1] - cross[a, 2] * B[r, i, 2]
                            )
                    for i in range(m):
                        for e in range(i + 1):
                            s = 0.0
                            if known:
                                for a in range(k):
                                    x = cross[a, 0] * B[r, e, 0] + cross[a, 1] * B[r, e, 1] + cross[a, 2] * B[r, e, 2]
                                    s += half[i, a] * A[r, e, a] - A[r, i, a] * x
                            for a in range(3):
                                for b in range(3):
                                    s += B[r, i, a] * Q[block, a, b] * B[r, e, b]
                            R[base + r, i, e] = s
                            R[base + r, e, i] = s
            p = end

    found: Callable[..., Any] = sized_covariances
    return found
