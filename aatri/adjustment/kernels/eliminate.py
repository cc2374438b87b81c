"""Elimination of blocks straight into the front of a node.

A block (a ground point) is met by rays: records with m residuals, a Jacobian A to the kept unknowns of one or more
parts (a pose; a camera) and B to the block. With whitened quantities, D = sum B'B + D0, h = sum B'v + h0, D = L L',

    front += A'A - Y Y',   Y = A'B L^-T,        gradient += A'v - Y L^-1 h

All rays of a block lie in one front. Entries are the distinct kept blocks a point meets: rays of the same image, or of
the same camera, share one. `loc` gives the row of each part in the front, -1 where the part is held altogether. The
lower triangle of the front is filled; rays of a block come in ascending order of their first part.

This is the general form; `eliminate_pose` is the same for two residuals and one part of six unknowns, the case of nearly
all rays.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

MOST_RAYS = 256
"""Most rays of an eliminated block; blocks with more are retained as unknowns."""

RANK_TOLERANCE = 1e-10
"""A pivot below this share of its diagonal means that the block is not determined."""

OPTIONS: dict[str, Any] = {"nogil": True, "cache": True, "fastmath": {"contract"}, "error_model": "numpy"}
"""Of the compiled functions: products may be fused with sums; a division by zero gives inf, not an exception."""

_ARRAYS = "float64[:,::1], float64[:,:,::1], float64[:,:,::1]"
GENERAL = (
    f"float64(int64, int64, int64, int64[::1], {_ARRAYS}, int32[:,::1], int32[::1], int32[::1], float64[:,:,::1], "
    "float64[:,::1], float64[:,::1], float64, float64[::1,:], float64[::1], float64[::1], float64[:,::1], "
    "float64[:,::1], float64[::1])"
)


@njit(
    "boolean(float64[:,::1], float64[::1], float64[::1], float64, float64[::1], float64[::1])", nogil=True, cache=True
)
def block_factor(D, h, free, damping, L, y):
    """Cholesky factor of a 3x3 block, L as (l00, l10, l20, l11, l21, l22), and y = L^-1 h; False if not positive."""
    for a in range(3):
        if free[a] == 0.0:
            for b in range(3):
                D[a, b] = 0.0
                D[b, a] = 0.0
            D[a, a] = 1.0
            h[a] = 0.0
        else:
            D[a, a] *= 1.0 + damping
    d1 = D[0, 0]
    if not d1 > 0.0:
        return False
    l00 = np.sqrt(d1)
    l10, l20 = D[1, 0] / l00, D[2, 0] / l00
    d2 = D[1, 1] - l10 * l10
    if not d2 > RANK_TOLERANCE * D[1, 1]:
        return False
    l11 = np.sqrt(d2)
    l21 = (D[2, 1] - l20 * l10) / l11
    d3 = D[2, 2] - l20 * l20 - l21 * l21
    if not d3 > RANK_TOLERANCE * D[2, 2]:
        return False
    l22 = np.sqrt(d3)
    L[0], L[1], L[2], L[3], L[4], L[5] = l00, l10, l20, l11, l21, l22
    y[0] = h[0] / l00
    y[1] = (h[1] - l10 * y[0]) / l11
    y[2] = (h[2] - l20 * y[0] - l21 * y[1]) / l22
    return True


@njit(GENERAL, **OPTIONS)
def eliminate(
    p0, p1, base, ray_start, v, A, B, loc, part_size, part_start, D0, h0, free, damping, F, g, diagonal, Ls, ys, lowest
):
    """Eliminate the blocks p0 ... p1 - 1, for any number of residuals and parts of any size.

    Parameters are those of `eliminate_pose`, and

    Parameters
    ----------
    A : (n, m, columns) float64
    loc : (n, parts) int32
    part_size, part_start : (parts,) int32
        Unknowns of each part and its first column in A.
    """
    m, parts, columns = v.shape[1], len(part_size), A.shape[2]
    largest = part_size.max()
    D, h, L, y = np.empty((3, 3)), np.empty(3), np.empty(6), np.empty(3)
    Y = np.zeros((MOST_RAYS * parts, largest, 3))
    at = np.empty(MOST_RAYS * parts, dtype=np.int32)
    size = np.empty(MOST_RAYS * parts, dtype=np.int32)
    W = np.empty((columns, 3))
    cost = 0.0
    for p in range(p0, p1):
        r0, r1 = ray_start[p] - base, ray_start[p + 1] - base
        for a in range(3):
            h[a] = h0[p, a]
            for b in range(3):
                D[a, b] = D0[p, a, b]
        for r in range(r0, r1):
            for i in range(m):
                cost += v[r, i] * v[r, i]
                for a in range(3):
                    h[a] += B[r, i, a] * v[r, i]
                    for b in range(3):
                        D[a, b] += B[r, i, a] * B[r, i, b]
        if not block_factor(D, h, free[p], damping, L, y):
            lowest[p] = 0.0
            continue
        for k in range(6):
            Ls[p, k] = L[k]
        for k in range(3):
            ys[p, k] = y[k]
        n = 0
        for r in range(r0, r1):
            for a in range(columns):
                s0, s1, s2 = 0.0, 0.0, 0.0
                for i in range(m):
                    s0 += A[r, i, a] * B[r, i, 0]
                    s1 += A[r, i, a] * B[r, i, 1]
                    s2 += A[r, i, a] * B[r, i, 2]
                t0 = s0 * free[p, 0] / L[0]
                t1 = (s1 * free[p, 1] - L[1] * t0) / L[3]
                W[a, 0], W[a, 1] = t0, t1
                W[a, 2] = (s2 * free[p, 2] - L[2] * t0 - L[4] * t1) / L[5]
            for part in range(parts):
                c = loc[r, part]
                if c < 0:
                    continue
                first, wide = part_start[part], part_size[part]
                q = 0
                while q < n and at[q] != c:
                    q += 1
                if q == n:
                    at[n], size[n] = c, wide
                    Y[n, :, :] = 0.0
                    n += 1
                for a in range(wide):
                    s = 0.0
                    for i in range(m):
                        s += A[r, i, first + a] * v[r, i]
                        diagonal[c + a] += A[r, i, first + a] ** 2
                    w0, w1, w2 = W[first + a, 0], W[first + a, 1], W[first + a, 2]
                    g[c + a] += s - w0 * y[0] - w1 * y[1] - w2 * y[2]
                    Y[q, a, 0] += w0
                    Y[q, a, 1] += w1
                    Y[q, a, 2] += w2
                for other in range(parts):
                    d = loc[r, other]
                    if d < 0 or d > c:
                        continue
                    for b in range(part_size[other]):
                        for a in range(wide):
                            s = 0.0
                            for i in range(m):
                                s += A[r, i, first + a] * A[r, i, part_start[other] + b]
                            F[c + a, d + b] += s
        for q in range(n):
            for k in range(n):
                if at[k] < at[q]:
                    continue
                for b in range(size[q]):
                    for a in range(size[k]):
                        F[at[k] + a, at[q] + b] -= (
                            Y[k, a, 0] * Y[q, b, 0] + Y[k, a, 1] * Y[q, b, 1] + Y[k, a, 2] * Y[q, b, 2]
                        )
    return cost


SUBSTITUTE = (
    "void(int64, int64, int64, int64[::1], float64[:,:,::1], float64[:,:,::1], int64[:,::1], int32[::1], int32[::1], "
    "float64[::1], float64[:,::1], float64[:,::1], float64[:,::1], float64[:,::1])"
)


@njit(SUBSTITUTE, **OPTIONS)
def substitute(p0, p1, base, ray_start, A, B, column, part_size, part_start, dx, free, Ls, ys, dy):
    """Steps of the eliminated blocks: dy = -L^-T (y + L^-1 sum B' A dx).

    Parameters
    ----------
    column : (n, parts) int64
        First kept column of each part, -1 where it is held.
    part_size, part_start : (parts,) int32
    dx : (n_kept,) float64
        Zero where held.
    dy : (n_blocks, 3) float64
        Filled in.
    """
    parts = len(part_size)
    for p in range(p0, p1):
        s0, s1, s2 = 0.0, 0.0, 0.0
        for r in range(ray_start[p] - base, ray_start[p + 1] - base):
            for i in range(A.shape[1]):
                t = 0.0
                for part in range(parts):
                    c, first = column[r, part], part_start[part]
                    if c >= 0:
                        for a in range(part_size[part]):
                            t += A[r, i, first + a] * dx[c + a]
                s0 += B[r, i, 0] * t
                s1 += B[r, i, 1] * t
                s2 += B[r, i, 2] * t
        z0 = s0 * free[p, 0] / Ls[p, 0]
        z1 = (s1 * free[p, 1] - Ls[p, 1] * z0) / Ls[p, 3]
        z2 = (s2 * free[p, 2] - Ls[p, 2] * z0 - Ls[p, 4] * z1) / Ls[p, 5]
        z0 += ys[p, 0]
        z1 += ys[p, 1]
        z2 += ys[p, 2]
        x2 = z2 / Ls[p, 5]
        x1 = (z1 - Ls[p, 4] * x2) / Ls[p, 3]
        x0 = (z0 - Ls[p, 1] * x1 - Ls[p, 2] * x2) / Ls[p, 0]
        dy[p, 0], dy[p, 1], dy[p, 2] = -x0 * free[p, 0], -x1 * free[p, 1], -x2 * free[p, 2]
