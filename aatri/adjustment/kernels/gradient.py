"""The gradient that eliminated blocks leave, ray by ray, with the factors of the blocks; no matrix is formed.

With whitened quantities, D = sum B'B + D0 = L L' and h = sum B'v + h0 of a block,

    gradient += A'(v - B L^-T y),     y = L^-1 h

as `eliminate` leaves it, at a fraction of the work.
"""

import numpy as np
from numba import njit

from aatri.adjustment.kernels.eliminate import block_factor
from aatri.adjustment.kernels.small import OPTIONS

_REDUCED = (
    "float64(int64, int64, int64, int64[::1], float64[:,::1], float64[:,:,::1], float64[:,:,::1], int64[:,::1], "
    "int32[::1], int32[::1], float64[:,:,::1], float64[:,::1], float64[:,::1], float64[::1], float64[:,::1], "
    "float64[:,::1], float64[::1])"
)


@njit(_REDUCED, **OPTIONS)
def reduced_gradient(
    p0, p1, base, ray_start, v, A, B, column, part_size, part_start, D0, h0, free, gradient, Ls, ys, lowest
):  # fmt: skip
    """Factors of the blocks p0 ... p1 - 1, and what their rays add to the gradient of the kept unknowns.

    Parameters
    ----------
    column : (n, parts) int64
        First kept column of each part, -1 where it is held.
    gradient : (n_kept,) float64
        Added to.
    p0, p1, base, ray_start, v, A, B, part_size, part_start, D0, h0, free, Ls, ys, lowest
        As in `eliminate`.

    Returns
    -------
    float
        Sum of squares of v.
    """
    D, h, cost = np.empty((3, 3)), np.empty(3), 0.0
    for p in range(p0, p1):
        r0, r1 = ray_start[p] - base, ray_start[p + 1] - base
        for a in range(3):
            h[a] = h0[p, a]
            for b in range(3):
                D[a, b] = D0[p, a, b]
        for r in range(r0, r1):
            for i in range(B.shape[1]):
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
        if not block_factor(D, h, free[p], 0.0, Ls[p], ys[p]):
            lowest[p] = 0.0
            continue
        z2 = ys[p, 2] / Ls[p, 5]
        z1 = (ys[p, 1] - Ls[p, 4] * z2) / Ls[p, 3]
        z0 = (ys[p, 0] - Ls[p, 1] * z1 - Ls[p, 2] * z2) / Ls[p, 0]
        z0, z1, z2 = z0 * free[p, 0], z1 * free[p, 1], z2 * free[p, 2]
        for r in range(r0, r1):
            for i in range(B.shape[1]):
                s = v[r, i] - B[r, i, 0] * z0 - B[r, i, 1] * z1 - B[r, i, 2] * z2
                for part in range(len(part_size)):
                    c, first = column[r, part], part_start[part]
                    if c >= 0:
                        for a in range(part_size[part]):
                            gradient[c + a] += A[r, i, first + a] * s
    return cost
