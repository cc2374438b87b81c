"""Elimination of ground points seen by single poses, a group of points at a time: the case of nearly all rays.

The method is that of `eliminate`, for two residuals and one part of six unknowns a ray. Blocks come in the order of the
places they meet, so that neighbours meet nearly the same. The blocks of a group share one list of places; their Y' stand
below one another in one matrix, zero where a block does not meet a place of its group, and the product of that matrix
with itself enters the front once for the whole group.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from aatri.adjustment.kernels.eliminate import MOST_RAYS, OPTIONS, block_factor

GROUP = 16
"""Most blocks of a group."""

SPARE = 3
"""Places a group may have beyond those of a block that joins it: with more, groups grow and so do the zeros."""

_RAYS = "float64[:,::1], float64[:,:,::1], float64[:,:,::1]"
POSE = (
    f"float64(int64, int64, int64, int64[::1], {_RAYS}, int32[:,::1], float64[:,:,::1], float64[:,::1], "
    "float64[:,::1], float64, float64[::1,:], float64[::1], float64[::1], float64[:,::1], float64[:,::1], float64[::1])"
)


@njit("UniTuple(int64, 2)(int64, int64, int64, int64[::1], int32[:,::1], int64[::1], int64[::1])", **OPTIONS)
def group_of(p0, p1, base, ray_start, loc, at, spare):
    """End of the group that starts with block p0, and the number of places it meets, ascending in `at`."""
    n = 0
    for p in range(p0, min(p1, p0 + GROUP)):
        i, m, own, previous = 0, 0, 0, np.int64(-1)
        for r in range(ray_start[p] - base, ray_start[p + 1] - base):
            c = np.int64(loc[r, 0])
            if c < 0 or c == previous:
                continue
            own, previous = own + 1, c
            while i < n and at[i] < c:
                spare[m] = at[i]
                m, i = m + 1, i + 1
            if i < n and at[i] == c:
                i += 1
            spare[m] = c
            m += 1
        while i < n:
            spare[m] = at[i]
            m, i = m + 1, i + 1
        if p > p0 and m > own + SPARE:
            return p, n
        n = m
        for k in range(n):
            at[k] = spare[k]
    return min(p1, p0 + GROUP), n


@njit("void(float64[:,::1], int64, int64, float64, float64, UniTuple(float64, 6), UniTuple(float64, 6))", **OPTIONS)
def add_row(M, i, j, s, t, a, c):
    """M[i, j : j + 6] += s a + t c; all is read before the first is written."""
    r0, r1, r2 = M[i, j] + s * a[0] + t * c[0], M[i, j + 1] + s * a[1] + t * c[1], M[i, j + 2] + s * a[2] + t * c[2]
    r3, r4 = M[i, j + 3] + s * a[3] + t * c[3], M[i, j + 4] + s * a[4] + t * c[4]
    r5 = M[i, j + 5] + s * a[5] + t * c[5]
    M[i, j], M[i, j + 1], M[i, j + 2], M[i, j + 3], M[i, j + 4], M[i, j + 5] = r0, r1, r2, r3, r4, r5


@njit(
    f"float64(int64, int64, int64, int64[::1], {_RAYS}, int32[:,::1], float64[:,:,::1], float64[:,::1], float64[:,::1], "
    "float64, float64[:,::1], float64[::1], int64[::1], float64[:,::1], float64[:,::1], float64[:,::1], float64[:,::1], "
    "float64[:,::1], float64[::1])",
    **OPTIONS,
)
def reduce_block(p, row, base, ray_start, v, A, B, loc, D0, h0, free, damping, D, h, at, Y, N, g, Ls, ys, lowest):
    """Factorise block p and write its Y' from the given row of its group on; A'A is summed in N, place by place.

    Views of arrays in the loops over rays would cost more than the arithmetic: all arrays are indexed as they are.

    Parameters
    ----------
    D, h : (3, 3), (3,) float64
        Work space.
    Y : (rows, 6 n) float64
    N : (6 n, 6) float64
    g : (1, k) float64
    """
    cost = 0.0
    d00, d10, d20, d11, d21, d22 = D0[p, 0, 0], D0[p, 1, 0], D0[p, 2, 0], D0[p, 1, 1], D0[p, 2, 1], D0[p, 2, 2]
    b0, b1, b2 = h0[p, 0], h0[p, 1], h0[p, 2]
    r0, r1 = ray_start[p] - base, ray_start[p + 1] - base
    for r in range(r0, r1):
        for i in range(2):
            x, y, z, e = B[r, i, 0], B[r, i, 1], B[r, i, 2], v[r, i]
            d00 += x * x
            d10 += x * y
            d20 += x * z
            d11 += y * y
            d21 += y * z
            d22 += z * z
            b0 += x * e
            b1 += y * e
            b2 += z * e
            cost += e * e
    D[0, 0], D[1, 0], D[2, 0], D[1, 1], D[2, 1], D[2, 2] = d00, d10, d20, d11, d21, d22
    h[0], h[1], h[2] = b0, b1, b2
    if not block_factor(D, h, free[p], damping, Ls[p], ys[p]):
        lowest[p] = 0.0
        return cost
    i0, i1, i2 = 1.0 / Ls[p, 0], 1.0 / Ls[p, 3], 1.0 / Ls[p, 5]
    f0, f1, f2 = free[p, 0] * i0, free[p, 1], free[p, 2]
    l1, l2, l4, y0, y1, y2 = Ls[p, 1], Ls[p, 2], Ls[p, 4], ys[p, 0], ys[p, 1], ys[p, 2]
    k = 0
    for r in range(r0, r1):
        c = np.int64(loc[r, 0])
        if c < 0:
            continue
        while at[k] < c:
            k += 1
        v0, v1, q = v[r, 0], v[r, 1], 6 * k
        # (u, w)' = B L^-T
        u0, w0 = B[r, 0, 0] * f0, B[r, 1, 0] * f0
        u1, w1 = (B[r, 0, 1] * f1 - l1 * u0) * i1, (B[r, 1, 1] * f1 - l1 * w0) * i1
        u2, w2 = (B[r, 0, 2] * f2 - l2 * u0 - l4 * u1) * i2, (B[r, 1, 2] * f2 - l2 * w0 - l4 * w1) * i2
        a = A[r, 0, 0], A[r, 0, 1], A[r, 0, 2], A[r, 0, 3], A[r, 0, 4], A[r, 0, 5]
        b = A[r, 1, 0], A[r, 1, 1], A[r, 1, 2], A[r, 1, 3], A[r, 1, 4], A[r, 1, 5]
        add_row(Y, row, q, u0, w0, a, b)
        add_row(Y, row + 1, q, u1, w1, a, b)
        add_row(Y, row + 2, q, u2, w2, a, b)
        add_row(g, 0, c, v0 - u0 * y0 - u1 * y1 - u2 * y2, v1 - w0 * y0 - w1 * y1 - w2 * y2, a, b)
        add_row(N, q, 0, a[0], b[0], a, b)
        add_row(N, q + 1, 0, a[1], b[1], a, b)
        add_row(N, q + 2, 0, a[2], b[2], a, b)
        add_row(N, q + 3, 0, a[3], b[3], a, b)
        add_row(N, q + 4, 0, a[4], b[4], a, b)
        add_row(N, q + 5, 0, a[5], b[5], a, b)
    return cost


@njit("void(int64, int64[::1], float64[:,::1], float64[:,::1], float64[::1,:], float64[::1])", **OPTIONS)
def add_group(n, at, S, N, F, diagonal):
    """Add A'A and subtract the product S of a group with n places, in the lower half of the front."""
    for q in range(n):
        for b in range(6):
            j, column = 6 * q + b, at[q] + b
            diagonal[column] += N[j, b]
            for a in range(6):
                S[j, 6 * q + a] -= N[j, a]
            for k in range(q, n):
                c, e = at[k], 6 * k
                # all six read before the first is written: otherwise every store might change the next operand
                s0, s1, s2 = F[c, column] - S[j, e], F[c + 1, column] - S[j, e + 1], F[c + 2, column] - S[j, e + 2]
                s3, s4 = F[c + 3, column] - S[j, e + 3], F[c + 4, column] - S[j, e + 4]
                s5 = F[c + 5, column] - S[j, e + 5]
                F[c, column], F[c + 1, column], F[c + 2, column] = s0, s1, s2
                F[c + 3, column], F[c + 4, column], F[c + 5, column] = s3, s4, s5


@njit(POSE, **OPTIONS)
def eliminate_pose(p0, p1, base, ray_start, v, A, B, loc, D0, h0, free, damping, F, g, diagonal, Ls, ys, lowest):
    """Eliminate the blocks p0 ... p1 - 1, two residuals and six kept unknowns a ray.

    Parameters
    ----------
    p0, p1 : int
    base : int
        Number of the ray in row 0 of v, A, B and loc.
    ray_start : (n_blocks + 1,) int64
    v : (n, 2) float64
    A : (n, 2, 6) float64
    B : (n, 2, 3) float64
    loc : (n, 1) int32
    D0, h0 : (n_blocks, 3, 3), (n_blocks, 3) float64
        From observations of the blocks alone.
    free : (n_blocks, 3) float64
        0 where the scalar is held.
    damping : float
    F : (k, k) float64, column-major; g, diagonal : (k,) float64
        Front, its gradient, and the diagonal of A'A.
    Ls, ys : (n_blocks, 6), (n_blocks, 3) float64
        Factors, for back substitution.
    lowest : (n_blocks,) float64
        Set to 0 where a block is not determined.

    Returns
    -------
    float
        Sum of squares of v.
    """
    at, spare = np.empty(3 * MOST_RAYS, dtype=np.int64), np.empty(3 * MOST_RAYS, dtype=np.int64)
    stacked, product, N = np.empty(0), np.empty(0), np.empty((0, 6))
    D, h, gradient = np.empty((3, 3)), np.empty(3), g.reshape((1, len(g)))
    cost, p = 0.0, p0
    while p < p1:
        end, n = group_of(p, p1, base, ray_start, loc, at, spare)
        rows, columns = 3 * (end - p), 6 * n
        if rows * columns > len(stacked):
            stacked = np.empty(2 * rows * columns)
        if columns * columns > len(product):
            product, N = np.empty(2 * columns * columns), np.empty((12 * n, 6))
        Y = stacked[: rows * columns].reshape((rows, columns))
        S = product[: columns * columns].reshape((columns, columns))
        Y[:], N[: 6 * n] = 0.0, 0.0
        for k in range(p, end):
            cost += reduce_block(
                k, 3 * (k - p), base, ray_start, v, A, B, loc, D0, h0, free, damping, D, h, at, Y, N, gradient,
                Ls, ys, lowest,
            )  # fmt: skip
        if n:
            np.dot(Y.T, Y, S)
            add_group(n, at, S, N, F, diagonal)
        p = end
    return cost
