"""Covariances of eliminated blocks and of their rays, while the covariance of the front is in memory.

With the front's covariance S, C = sum B'A over the rays of a block, Z = L^-1 C, the block has
Q = L^-T (I + Z S Z') L^-1, and its covariance with the kept unknowns is -L^-T Z S. The adjusted value of a ray has

    A S A' + A Q_xy B' + (A Q_xy B')' + B Q B'

Blocks are worked on in the groups of `eliminate`: the part of S that a group meets is gathered once, and one product S Z
serves all its blocks.
"""

import numpy as np
from numba import njit

from aatri.adjustment.kernels.eliminate import MOST_RAYS, group_of
from aatri.adjustment.kernels.ray_loops import (
    gather,
    gather_images,
    gather_models,
    image_product,
    image_ray_onto,
    model_product,
    model_ray_onto,
    product,
    ray_onto,
    size_of,
)
from aatri.adjustment.kernels.small import OPTIONS

_COVARIANCES = (
    "void(int64, int64, int64, int64[::1], boolean[::1], float64[:,:,::1], float64[:,:,::1], int32[:,::1], int32[::1], "
    "int32[::1], float64[::1,:], float64[:,::1], float64[:,::1], float64[:,:,::1], float64[:,:,::1], float64[:,:,::1])"
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


@njit(_COVARIANCES, **OPTIONS)
def block_covariances(p0, p1, base, ray_start, active, A, B, loc, part_size, part_start, S, free, Ls, Q, R, X):
    """Covariances of the blocks p0 ... p1 - 1 and of the adjusted values of their rays, see `eliminate`.

    Parameters
    ----------
    p0, p1 : int
    base : int
        Number of the ray in row 0 of A, B, loc, R and X.
    ray_start : (n_blocks + 1,) int64
    active : (n,) bool
        Others are predicted: they are no part of C.
    A, B : (n, m, columns), (n, m, 3) float64
    loc : (n, parts) int32
        Row of the front of each part, -1 where it is held.
    part_size, part_start : (parts,) int32
        Unknowns of each part and its first column in A.
    S : (k, k) float64, column-major
        Covariance of the front, zero for unknowns that are held.
    free, Ls : (n_blocks, 3), (n_blocks, 6) float64
    Q : (n_blocks, 3, 3) float64
        Filled in.
    R : (n, m, m) float64
        Filled in: covariance of the adjusted, whitened value of each ray.
    X : (n, columns, 3) float64, or without rows
        Filled in: minus the covariance of the kept unknowns of each ray with its block.
    """
    m, parts, wide = A.shape[1], loc.shape[1], A.shape[2]
    size = size_of(m, parts, wide)
    places = np.empty((2, 2 * MOST_RAYS * parts), dtype=np.int64)
    gathered, stacked, multiplied = np.empty(0), np.empty(0), np.empty(0)
    G, inverse, cross = np.empty((3, 3)), np.zeros((3, 3)), np.zeros((wide, 3))
    half, W, here = np.empty((m, wide)), np.empty((m, 3)), np.zeros(parts, dtype=np.int64)
    p = p0
    while p < p1:
        end, n = group_of(p, p1, base, ray_start, loc, part_size, places)
        rows, columns = places[1, n], 3 * (end - p)
        if rows * rows > len(gathered):
            gathered = np.empty(2 * rows * rows)
        if rows * columns > len(stacked):
            stacked, multiplied = np.empty(2 * rows * columns), np.empty(2 * rows * columns)
        part_S = gathered[: rows * rows].reshape((rows, rows))
        Z = stacked[: rows * columns].reshape((rows, columns))
        T = multiplied[: rows * columns].reshape((rows, columns))
        if size == 0:
            gather_images(n, places, S, part_S)
        elif size == 1:
            gather_models(n, places, S, part_S)
        else:
            gather(n, places, S, part_S)
        Z[:] = 0.0
        for block in range(p, end):  # Z = L^-1 B'A, transposed
            j = 3 * (block - p)
            i0, i1, i2 = 1.0 / Ls[block, 0], 1.0 / Ls[block, 3], 1.0 / Ls[block, 5]
            f0, f1, f2 = free[block, 0] * i0, free[block, 1], free[block, 2]
            l1, l2, l4 = Ls[block, 1], Ls[block, 2], Ls[block, 4]
            here[:] = 0
            for r in range(ray_start[block] - base, ray_start[block + 1] - base):
                if not active[r]:
                    continue
                for part in range(parts):
                    c, q = np.int64(loc[r, part]), here[part]
                    if c < 0:
                        continue
                    if places[0, q] > c:
                        q = 0
                    while places[0, q] < c:
                        q += 1
                    here[part] = q
                    k, o, s = np.int64(part_size[part]), places[1, q], np.int64(part_start[part])
                    if size == 0:
                        image_ray_onto(2, 6, r, s, o, j, f0, f1, f2, i1, i2, l1, l2, l4, A, B, Z)
                    elif size == 1:
                        model_ray_onto(3, 7, r, s, o, j, f0, f1, f2, i1, i2, l1, l2, l4, A, B, Z)
                    else:
                        ray_onto(m, k, r, s, o, j, f0, f1, f2, i1, i2, l1, l2, l4, A, B, Z)
        if n:
            np.dot(part_S, Z, T)
        for block in range(p, end):
            j = 3 * (block - p)
            g00, g10, g11, g20, g21, g22 = 1.0, 0.0, 1.0, 0.0, 0.0, 1.0  # symmetric, as the part of S is
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
            here[:] = 0
            for r in range(ray_start[block] - base, ray_start[block + 1] - base):
                for i in range(m):
                    for b in range(3):
                        W[i, b] = 0.5 * (
                            Q[block, b, 0] * B[r, i, 0] + Q[block, b, 1] * B[r, i, 1] + Q[block, b, 2] * B[r, i, 2]
                        )
                for part in range(parts):
                    c, q = np.int64(loc[r, part]), here[part]
                    if c < 0:
                        continue
                    if places[0, q] > c:
                        q = 0
                    while places[0, q] < c:
                        q += 1
                    here[part] = q
                for part in range(parts):
                    k, o, s = np.int64(part_size[part]), places[1, here[part]], np.int64(part_start[part])
                    if loc[r, part] < 0:
                        half[:, s : s + k], cross[s : s + k] = 0.0, 0.0
                        continue
                    for a in range(k):  # minus the covariance of the part's unknowns with the block
                        t0, t1, t2 = T[o + a, j], T[o + a, j + 1], T[o + a, j + 2]
                        cross[s + a, 0] = i00 * t0 + i10 * t1 + i20 * t2
                        cross[s + a, 1] = i11 * t1 + i21 * t2
                        cross[s + a, 2] = i22 * t2
                    if size == 0:
                        image_product(2, 6, 6, r, s, o, s, o, part_S, A, half)
                    elif size == 1:
                        model_product(3, 7, 7, r, s, o, s, o, part_S, A, half)
                    else:
                        half[:, s : s + k] = 0.0
                        for other in range(parts):
                            if loc[r, other] >= 0:
                                first, t = np.int64(part_start[other]), places[1, here[other]]
                                product(m, k, np.int64(part_size[other]), r, s, o, first, t, part_S, A, half)
                    for i in range(m):
                        w0, w1, w2 = W[i, 0], W[i, 1], W[i, 2]
                        for a in range(k):
                            w0 -= A[r, i, s + a] * cross[s + a, 0]
                            w1 -= A[r, i, s + a] * cross[s + a, 1]
                            w2 -= A[r, i, s + a] * cross[s + a, 2]
                        W[i, 0], W[i, 1], W[i, 2] = w0, w1, w2
                if len(X):
                    for a in range(wide):
                        for b in range(3):
                            X[r, a, b] = cross[a, b]
                for i in range(m):
                    for e in range(i + 1):
                        x = W[i, 0] * B[r, e, 0] + W[i, 1] * B[r, e, 1] + W[i, 2] * B[r, e, 2]
                        x += W[e, 0] * B[r, i, 0] + W[e, 1] * B[r, i, 1] + W[e, 2] * B[r, i, 2]
                        for a in range(wide):
                            x += half[i, a] * A[r, e, a]
                        R[r, i, e] = x
                        R[r, e, i] = x
        p = end


@njit("float64[::1,:](float64[::1,:], int32[::1])", nogil=True, cache=True)
def part_of(S, row):
    """Rows and columns `row` of a matrix, column-major."""
    n = len(row)
    part = np.empty((n, n)).T
    for j in range(n):
        for i in range(n):
            part[i, j] = S[row[i], row[j]]
    return part
