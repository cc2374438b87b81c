"""Factors of eliminated blocks without a front: what a new gradient needs where the reduced normal matrix is an old one.

With whitened quantities, D = sum B'B + D0 = L L', h = sum B'v + h0 and y = L^-1 h of a block, as `eliminate` leaves them.
With these `implicit.onto_kept` adds A'(v - B L^-T y), the gradient of the kept unknowns.
"""

import numpy as np
from numba import njit

from aatri.adjustment.kernels.eliminate import block_factor
from aatri.adjustment.kernels.small import OPTIONS

_FACTORS = (
    "float64(int64, int64, int64, int64[::1], float64[:,::1], float64[:,:,::1], float64[:,:,::1], float64[:,::1], "
    "float64[:,::1], float64[:,::1], float64[:,::1], float64[::1])"
)


@njit(_FACTORS, **OPTIONS)
def block_factors(p0, p1, base, ray_start, v, B, D0, h0, free, Ls, ys, lowest):
    """Factor the blocks p0 ... p1 - 1, undamped.

    Parameters
    ----------
    p0, p1, base, ray_start, v, B, D0, h0, free, Ls, ys, lowest
        As in `eliminate`.

    Returns
    -------
    float
        Sum of squares of v.
    """
    D, h, cost = np.empty((3, 3)), np.empty(3), 0.0
    for p in range(p0, p1):
        for a in range(3):
            h[a] = h0[p, a]
            for b in range(3):
                D[a, b] = D0[p, a, b]
        for r in range(ray_start[p] - base, ray_start[p + 1] - base):
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
    return cost
