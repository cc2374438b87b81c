"""Elimination of blocks straight into the front of a node, a group of blocks at a time.

A block (a ground point) is met by rays: records with m residuals, a Jacobian A to the kept unknowns of one or more
parts (a pose; a camera) and B to the block. With whitened quantities, D = sum B'B + D0, h = sum B'v + h0, D = L L',

    front += A'A - Y Y',   Y = A'B L^-T,        gradient += A'v - Y L^-1 h

All rays of a block lie in one front. `loc` gives the row of each part in the front, its place; -1 where the part is held
altogether. Rays of the same image, or of the same camera, share a place. The lower triangle of the front is filled.

Blocks come in the order of the places they meet, so that neighbours meet nearly the same. The blocks of a group share
one list of places; their Y' stand below one another in one matrix, zero where a block does not meet a place of its
group, and the product of that matrix with itself enters the front once for the whole group.
"""

import numpy as np
from numba import njit

from aatri.adjustment.kernels.ray_loops import (
    add_image_ray,
    add_model_ray,
    add_ray,
    images_into_front,
    into_front,
    models_into_front,
    size_of,
)
from aatri.adjustment.kernels.small import OPTIONS

MOST_RAYS = 256
"""Most rays of an eliminated block; blocks with more are retained as unknowns."""

RANK_TOLERANCE = 1e-10
"""A pivot below this share of its diagonal means that the block is not determined."""

GROUP = 16
"""Most blocks of a group."""

SPARE = 3
"""Places a group may have beyond those of a block that joins it: with more, groups grow and so do the zeros."""

_ELIMINATE = (
    "float64(int64, int64, int64, int64[::1], float64[:,::1], float64[:,:,::1], float64[:,:,::1], int32[:,::1], "
    "int32[::1], int32[::1], float64[:,:,::1], float64[:,::1], float64[:,::1], float64, float64[::1,:], float64[::1], "
    "float64[::1], float64[:,::1], float64[:,::1], float64[::1])"
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


@njit("UniTuple(int64, 2)(int64, int64, int32[:,::1], int32[::1], int64[:,::1], int64, boolean)", **OPTIONS)
def places_met(r0, r1, loc, part_size, places, n, join):
    """Number of places that rays r0 ... r1 - 1 meet, and of those not among the first n, which may `join` them."""
    met, new = 0, 0
    for part in range(loc.shape[1]):
        q, previous = 0, np.int64(-1)
        for r in range(r0, r1):
            c = np.int64(loc[r, part])
            if c < 0 or c == previous:
                continue
            if c < previous:
                q = 0
            met, previous = met + 1, c
            while q < n and places[0, q] < c:
                q += 1
            if q < n and places[0, q] == c:
                continue
            new += 1
            if join:
                for k in range(n, q, -1):
                    places[0, k], places[1, k] = places[0, k - 1], places[1, k - 1]
                places[0, q], places[1, q], n = c, part_size[part], n + 1
    return met, new


@njit("UniTuple(int64, 2)(int64, int64, int64, int64[::1], int32[:,::1], int32[::1], int64[:,::1])", **OPTIONS)
def group_of(p0, p1, base, ray_start, loc, part_size, places):
    """End of the group that starts with block p0, and the number of places it meets.

    Parameters
    ----------
    places : (2, most) int64
        Filled in: the places, ascending, and the first column of each among those of the group, with their end.
    """
    n, end = 0, min(p1, p0 + GROUP)
    for p in range(p0, end):
        r0, r1 = ray_start[p] - base, ray_start[p + 1] - base
        met, new = places_met(r0, r1, loc, part_size, places, n, False)
        if p > p0 and n + new > met + SPARE:
            end = p
            break
        if new:
            n += places_met(r0, r1, loc, part_size, places, n, True)[1]
    first = 0
    for q in range(n):
        first, places[1, q] = first + places[1, q], first
    places[1, n] = first
    return end, n


@njit(_ELIMINATE, **OPTIONS)
def eliminate(
    p0, p1, base, ray_start, v, A, B, loc, part_size, part_start, D0, h0, free, damping, F, g, diagonal, Ls, ys,
    lowest,
):  # fmt: skip
    """Eliminate the blocks p0 ... p1 - 1, for any number of residuals and parts a ray.

    Parameters
    ----------
    p0, p1 : int
    base : int
        Number of the ray in row 0 of v, A, B and loc.
    ray_start : (n_blocks + 1,) int64
    v, A, B : (n, m), (n, m, columns), (n, m, 3) float64
    loc : (n, parts) int32
    part_size, part_start : (parts,) int32
        Unknowns of each part and its first column in A.
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
    m, parts, widest = B.shape[1], loc.shape[1], A.shape[2]
    size = size_of(m, parts, widest)
    places = np.empty((2, 2 * MOST_RAYS * parts), dtype=np.int64)
    stacked, product, N = np.empty(0), np.empty(0), np.empty((0, widest))
    D, h, here = np.empty((3, 3)), np.empty(3), np.zeros(parts, dtype=np.int64)
    cost, p = 0.0, p0
    while p < p1:
        end, n = group_of(p, p1, base, ray_start, loc, part_size, places)
        rows, columns = 3 * (end - p), places[1, n]
        if rows * columns > len(stacked):
            stacked = np.empty(2 * rows * columns)
        if columns * columns > len(product):
            product, N = np.empty(2 * columns * columns), np.empty((2 * columns, widest))
        Y = stacked[: rows * columns].reshape((rows, columns))
        S = product[: columns * columns].reshape((columns, columns))
        Y[:], N[:columns] = 0.0, 0.0
        for block in range(p, end):
            for a in range(3):
                h[a] = h0[block, a]
                for b in range(3):
                    D[a, b] = D0[block, a, b]
            r0, r1, row = ray_start[block] - base, ray_start[block + 1] - base, 3 * (block - p)
            for r in range(r0, r1):
                for i in range(m):
                    x, y, z, e = B[r, i, 0], B[r, i, 1], B[r, i, 2], v[r, i]
                    D[0, 0] += x * x
                    D[1, 0] += y * x
                    D[2, 0] += z * x
                    D[1, 1] += y * y
                    D[2, 1] += y * z
                    D[2, 2] += z * z
                    h[0] += x * e
                    h[1] += y * e
                    h[2] += z * e
                    cost += e * e
            if not block_factor(D, h, free[block], damping, Ls[block], ys[block]):
                lowest[block] = 0.0
                continue
            i0, i1, i2 = 1.0 / Ls[block, 0], 1.0 / Ls[block, 3], 1.0 / Ls[block, 5]
            f0, f1, f2 = free[block, 0] * i0, free[block, 1], free[block, 2]
            l1, l2, l4 = Ls[block, 1], Ls[block, 2], Ls[block, 4]
            y0, y1, y2 = ys[block, 0], ys[block, 1], ys[block, 2]
            here[:] = 0
            for r in range(r0, r1):
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
                        add_image_ray(
                            2, 6, r, s, row, o, c, f0, f1, f2, i1, i2, l1, l2, l4, y0, y1, y2, v, A, B, Y, N, g
                        )
                    elif size == 1:
                        add_model_ray(
                            3, 7, r, s, row, o, c, f0, f1, f2, i1, i2, l1, l2, l4, y0, y1, y2, v, A, B, Y, N, g
                        )
                    else:
                        add_ray(m, k, r, s, row, o, c, f0, f1, f2, i1, i2, l1, l2, l4, y0, y1, y2, v, A, B, Y, N, g)
                    for other in range(parts):
                        d = np.int64(loc[r, other])
                        if other == part or d < 0 or d > c:
                            continue
                        t = np.int64(part_start[other])
                        for i in range(m):
                            for b in range(part_size[other]):
                                x = A[r, i, t + b]
                                for a in range(k):
                                    F[c + a, d + b] += A[r, i, s + a] * x
        if n:
            np.dot(Y.T, Y, S)
        if size == 0:
            images_into_front(n, places, S, N, F, diagonal)
        elif size == 1:
            models_into_front(n, places, S, N, F, diagonal)
        else:
            into_front(n, places, S, N, F, diagonal)
        p = end
    return cost
