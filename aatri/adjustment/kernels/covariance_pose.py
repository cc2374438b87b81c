"""Covariances of ground points seen by single poses, and of their rays, a group of points at a time.

The method is that of `covariance`, the groups are those of `eliminate_pose`: the part S of the front's covariance that a
group meets is gathered once, and one product S Z serves all its blocks. Jacobians of held unknowns are zero.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from aatri.adjustment.kernels.covariance import from_factor
from aatri.adjustment.kernels.eliminate import MOST_RAYS, OPTIONS
from aatri.adjustment.kernels.eliminate_pose import group_of

_LOCAL = "int64, int64[::1], float64[:,:,::1], float64[:,:,::1], int32[:,::1], int64[::1]"
POSE = (
    "void(int64, int64, int64, int64[::1], boolean[::1], float64[:,:,::1], float64[:,:,::1], int32[:,::1], float64[::1,:], "
    "float64[:,::1], float64[:,::1], float64[:,:,::1], float64[:,:,::1], float64[:,:,::1])"
)


@njit("void(int64, int64[::1], float64[::1,:], float64[:,::1])", **OPTIONS)
def gather(n, at, S, part):
    """Rows and columns of n places of a symmetric matrix, six each."""
    for q in range(n):
        for b in range(6):
            for k in range(n):
                for a in range(6):
                    part[6 * q + b, 6 * k + a] = S[at[k] + a, at[q] + b]


@njit(f"void(int64, int64, boolean[::1], {_LOCAL}, float64[:,::1], float64[:,::1], float64[:,::1])", **OPTIONS)
def fill_z(p, column, active, base, ray_start, A, B, loc, at, free, Ls, Z):
    """Z = L^-1 B'A of block p, transposed, in three columns of its group."""
    i0, i1, i2 = 1.0 / Ls[p, 0], 1.0 / Ls[p, 3], 1.0 / Ls[p, 5]
    f0, f1, f2 = free[p, 0] * i0, free[p, 1], free[p, 2]
    l1, l2, l4 = Ls[p, 1], Ls[p, 2], Ls[p, 4]
    k = 0
    for r in range(ray_start[p] - base, ray_start[p + 1] - base):
        c = np.int64(loc[r, 0])
        if c < 0 or not active[r]:
            continue
        while at[k] < c:
            k += 1
        u0, w0 = B[r, 0, 0] * f0, B[r, 1, 0] * f0
        u1, w1 = (B[r, 0, 1] * f1 - l1 * u0) * i1, (B[r, 1, 1] * f1 - l1 * w0) * i1
        u2, w2 = (B[r, 0, 2] * f2 - l2 * u0 - l4 * u1) * i2, (B[r, 1, 2] * f2 - l2 * w0 - l4 * w1) * i2
        for a in range(6):
            a0, a1 = A[r, 0, a], A[r, 1, a]
            Z[6 * k + a, column] += a0 * u0 + a1 * w0
            Z[6 * k + a, column + 1] += a0 * u1 + a1 * w1
            Z[6 * k + a, column + 2] += a0 * u2 + a1 * w2


@njit(
    f"void(int64, int64, {_LOCAL}, float64[:,::1], float64[:,::1], float64[:,::1], float64[:,::1], float64[:,:,::1], "
    "float64[:,:,::1], float64[:,:,::1])",
    **OPTIONS,
)
def ray_covariances(p, column, base, ray_start, A, B, loc, at, part, T, inverse, free, Q, R, X):
    """Covariance of the adjusted values of the rays of block p, from T = S Z and Q."""
    k = 0
    i00, i10, i20 = inverse[0, 0] * free[p, 0], inverse[1, 0] * free[p, 0], inverse[2, 0] * free[p, 0]
    i11, i21, i22 = inverse[1, 1] * free[p, 1], inverse[2, 1] * free[p, 1], inverse[2, 2] * free[p, 2]
    for r in range(ray_start[p] - base, ray_start[p + 1] - base):
        c = np.int64(loc[r, 0])
        if len(X):
            X[r] = 0.0
        r00, r10, r11 = 0.0, 0.0, 0.0
        for a in range(3):
            s0, s1 = 0.0, 0.0
            for b in range(3):
                s0 += Q[p, a, b] * B[r, 0, b]
                s1 += Q[p, a, b] * B[r, 1, b]
            r00 += B[r, 0, a] * s0
            r10 += B[r, 1, a] * s0
            r11 += B[r, 1, a] * s1
        if c >= 0:
            while at[k] < c:
                k += 1
            for a in range(6):
                j = 6 * k + a
                t0, t1, t2 = T[j, column], T[j, column + 1], T[j, column + 2]
                # minus the covariance of the pose's unknown with the block
                c0, c1, c2 = i00 * t0 + i10 * t1 + i20 * t2, i11 * t1 + i21 * t2, i22 * t2
                if len(X):
                    X[r, a, 0], X[r, a, 1], X[r, a, 2] = c0, c1, c2
                s0, s1 = 0.0, 0.0
                for b in range(6):
                    s0 += part[j, 6 * k + b] * A[r, 0, b]
                    s1 += part[j, 6 * k + b] * A[r, 1, b]
                x0 = c0 * B[r, 0, 0] + c1 * B[r, 0, 1] + c2 * B[r, 0, 2]
                x1 = c0 * B[r, 1, 0] + c1 * B[r, 1, 1] + c2 * B[r, 1, 2]
                r00 += A[r, 0, a] * (s0 - 2 * x0)
                r11 += A[r, 1, a] * (s1 - 2 * x1)
                r10 += A[r, 1, a] * (s0 - x0) - A[r, 0, a] * x1
        at_ray = base + r
        R[at_ray, 0, 0], R[at_ray, 1, 0], R[at_ray, 0, 1], R[at_ray, 1, 1] = r00, r10, r10, r11


@njit(POSE, **OPTIONS)
def pose_covariances(p0, p1, base, ray_start, active, A, B, loc, S, free, Ls, Q, R, X):
    """Covariance of the blocks p0 ... p1 - 1 and of the adjusted values of their rays.

    Parameters
    ----------
    base : int
        Number of the ray in row 0 of A, B and loc.
    active : (n,) bool
        Others are predicted.
    A, B : (n, 2, 6), (n, 2, 3) float64
    loc : (n, 1) int32
    S : (k, k) float64, column-major
        Covariance of the front.
    free, Ls : (n_blocks, 3), (n_blocks, 6) float64
    Q : (n_blocks, 3, 3) float64
        Filled in.
    R : (n_rays, 2, 2) float64
        Filled in.
    X : (n, 6, 3) float64, or without rows
        Filled in: minus the covariance of the pose of each ray with its block; zero where the pose is held.
    """
    at, spare = np.empty(3 * MOST_RAYS, dtype=np.int64), np.empty(3 * MOST_RAYS, dtype=np.int64)
    gathered, stacked, product = np.empty(0), np.empty(0), np.empty(0)
    G, inverse, p = np.empty((3, 3)), np.zeros((3, 3)), p0
    while p < p1:
        end, n = group_of(p, p1, base, ray_start, loc, at, spare)
        rows, columns = 6 * n, 3 * (end - p)
        if rows * rows > len(gathered):
            gathered = np.empty(2 * rows * rows)
        if rows * columns > len(stacked):
            stacked, product = np.empty(2 * rows * columns), np.empty(2 * rows * columns)
        part = gathered[: rows * rows].reshape((rows, rows))
        Z = stacked[: rows * columns].reshape((rows, columns))
        T = product[: rows * columns].reshape((rows, columns))
        gather(n, at, S, part)
        Z[:] = 0.0
        for k in range(p, end):
            fill_z(k, 3 * (k - p), active, base, ray_start, A, B, loc, at, free, Ls, Z)
        if n:
            np.dot(part, Z, T)
        for k in range(p, end):
            j = 3 * (k - p)
            for a in range(3):
                for b in range(3):
                    s = 1.0 if a == b else 0.0
                    for i in range(rows):
                        s += T[i, j + a] * Z[i, j + b]
                    G[a, b] = s
            from_factor(k, Ls, G, free, inverse, Q)
            ray_covariances(k, j, base, ray_start, A, B, loc, at, part, T, inverse, free, Q, R, X)
        p = end
