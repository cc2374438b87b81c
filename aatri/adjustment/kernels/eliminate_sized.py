"""Elimination of blocks met by rays of one part, a group of blocks at a time, for any pair of sizes.

The method is that of `eliminate_pose`, for m residuals and one part of k unknowns a ray: strips and models (3 and 7, 3 and
15), images with film unknowns (2 and 12). Both sizes are constants of the compiled code, so that loops over them are
unrolled; above `UNROLLED` unknowns that gains nothing, and one function serves all sizes. `eliminator` compiles a pair
when it is first asked for, and finds it in the cache from then on: a function that encloses nothing but numbers may be
cached. The pairs that nearly every block needs are compiled with the module.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numba import njit

from aatri.adjustment.kernels.eliminate import MOST_RAYS, OPTIONS, block_factor
from aatri.adjustment.kernels.eliminate_pose import POSE, eliminate_pose, group_of

UNROLLED = 8
"""Most unknowns a ray for which loops of constant length are faster: 3 times at 7, not at 12 and 15 (measured)."""


def eliminator(m: int, k: int) -> Callable[..., Any]:
    """`eliminate_pose` for m residuals and k kept unknowns a ray, with the same parameters; itself for 2 and 6."""
    if (m, k) == (2, 6):
        return eliminate_pose
    return _eliminator(m, k) if k <= UNROLLED else _eliminator(0, 0)


@cache
def _eliminator(of_m: int, of_k: int) -> Callable[..., Any]:
    """The function for a pair of sizes; for zeros that of any sizes."""

    @njit(POSE, **OPTIONS)
    def eliminate_sized(p0, p1, base, ray_start, v, A, B, loc, D0, h0, free, damping, F, g, diagonal, Ls, ys, lowest):
        m = of_m if of_m else B.shape[1]
        k = of_k if of_k else A.shape[2]
        at, spare = np.empty(3 * MOST_RAYS, dtype=np.int64), np.empty(3 * MOST_RAYS, dtype=np.int64)
        stacked, product, N = np.empty(0), np.empty(0), np.empty((0, k))
        D, h = np.empty((3, 3)), np.empty(3)
        cost, p = 0.0, p0
        while p < p1:
            end, n = group_of(p, p1, base, ray_start, loc, at, spare)
            rows, columns = 3 * (end - p), k * n
            if rows * columns > len(stacked):
                stacked = np.empty(2 * rows * columns)
            if columns * columns > len(product):
                product, N = np.empty(2 * columns * columns), np.empty((2 * columns, k))
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
                q = 0
                for r in range(r0, r1):
                    c = np.int64(loc[r, 0])
                    if c < 0:
                        continue
                    while at[q] < c:
                        q += 1
                    o = k * q
                    for i in range(m):
                        # a row of B L^-T, and what is left of v
                        u0 = B[r, i, 0] * f0
                        u1 = (B[r, i, 1] * f1 - l1 * u0) * i1
                        u2 = (B[r, i, 2] * f2 - l2 * u0 - l4 * u1) * i2
                        e = v[r, i] - u0 * y0 - u1 * y1 - u2 * y2
                        for a in range(k):
                            Y[row, o + a] += u0 * A[r, i, a]
                        for a in range(k):
                            Y[row + 1, o + a] += u1 * A[r, i, a]
                        for a in range(k):
                            Y[row + 2, o + a] += u2 * A[r, i, a]
                        for a in range(k):
                            g[c + a] += e * A[r, i, a]
                        for a in range(k):
                            x = A[r, i, a]
                            for b in range(k):
                                N[o + a, b] += x * A[r, i, b]
            if n:
                np.dot(Y.T, Y, S)
            for q in range(n):
                for b in range(k):
                    j, column = k * q + b, at[q] + b
                    diagonal[column] += N[j, b]
                    for a in range(k):
                        S[j, k * q + a] -= N[j, a]
                    for other in range(q, n):
                        c, e0 = at[other], k * other
                        for a in range(k):
                            F[c + a, column] -= S[j, e0 + a]
            p = end
        return cost

    found: Callable[..., Any] = eliminate_sized
    return found


for sizes in ((3, 7), (0, 0)):
    _eliminator(*sizes)
