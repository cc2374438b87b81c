"""What eliminated blocks leave of effects on their rays, unit by unit; see `elimination.effects`."""

import numpy as np
from numba import njit

from aatri.adjustment.kernels.small import OPTIONS

_ROWS = "float64[:,::1]"
_SIGNATURE = (
    f"void(int64, int64, int64, int64[::1], {_ROWS}, float64[:,:,::1], float64[:,:,::1], int64[:,::1], int32[::1], "
    f"int32[::1], {_ROWS}, {_ROWS}, {_ROWS}, int64[::1], int64[::1], float64[:,:,::1], {_ROWS}, {_ROWS}, {_ROWS}, "
    "float64[:,:,::1])"
)


@njit(f"void(float64[:,:,::1], int64, {_ROWS}, int64[:,::1], int32[::1], int32[::1], {_ROWS}, int64)", **OPTIONS)
def add_products(A, r, t, column, part_size, part_start, x, first):
    """x += A't of one ray, in the columns from `first` on."""
    for part in range(len(part_size)):
        c, start = column[r, part], part_start[part]
        for a in range(part_size[part] if c >= 0 else 0):
            for i in range(t.shape[0]):
                s = A[r, i, start + a]
                for b in range(t.shape[1]):
                    x[c + a, first + b] += s * t[i, b]


@njit(_SIGNATURE, **OPTIONS)
def reduce_effects(
    p0,
    p1,
    base,
    ray_start,
    v,
    A,
    B,
    column,
    part_size,
    part_start,
    free,
    Ls,
    ys,
    ray,
    unit,
    H,
    x,
    total,
    gradient,
    information,
):
    """Add the effects on the rays of the blocks p0 ... p1 - 1; per block and unit c = B'H, U = L^-1 c, w = L^-T U.

    Parameters
    ----------
    v, A, B : (n, m), (n, m, columns), (n, m, 3) float64
        Whitened rays from `base` on.
    column : (n, parts) int64
        First kept column of each part, -1 where it is held.
    part_size, part_start : (parts,) int32
    free, Ls, ys : (n_blocks, 3), (n_blocks, 6), (n_blocks, 3) float64
    ray, unit, H : (e,), (e,) int64, (e, m, k) float64
        Whitened effects on rays, ascending: a ray may be in several units.
    x : (n_kept, units k) float64
        A'(H - B w) is added.
    total, gradient, information : (units, k), (units, k), (units, k, k) float64
        The diagonal of H'H, H'v - U'y, and H'H - U'U are added.
    """
    m, k, e = H.shape[1], H.shape[2], 0
    units, met = np.empty(len(total), dtype=np.int64), np.zeros(len(total), dtype=np.bool_)
    C, t = np.empty((len(total), 3, k)), np.empty((m, k))
    for p in range(p0, p1):
        n = 0
        while e < len(ray) and ray[e] < ray_start[p + 1]:
            r, u = ray[e] - base, unit[e]
            if not met[u]:
                met[u], units[n], C[u] = True, u, 0.0
                n += 1
            for i in range(m):
                for b in range(k):
                    h = H[e, i, b]
                    total[u, b] += h * h
                    gradient[u, b] += h * v[r, i]
                    for d in range(k):
                        information[u, b, d] += h * H[e, i, d]
                    for a in range(3):
                        C[u, a, b] += B[r, i, a] * h
                    t[i, b] = h
            add_products(A, r, t, column, part_size, part_start, x, u * k)
            e += 1
        l00, l10, l20, l11, l21, l22 = Ls[p, 0], Ls[p, 1], Ls[p, 2], Ls[p, 3], Ls[p, 4], Ls[p, 5]
        for q in range(n):
            u = units[q]
            met[u] = False
            for b in range(k):
                U0 = C[u, 0, b] * free[p, 0] / l00
                U1 = (C[u, 1, b] * free[p, 1] - l10 * U0) / l11
                U2 = (C[u, 2, b] * free[p, 2] - l20 * U0 - l21 * U1) / l22
                C[u, 0, b], C[u, 1, b], C[u, 2, b] = U0, U1, U2
                gradient[u, b] -= U0 * ys[p, 0] + U1 * ys[p, 1] + U2 * ys[p, 2]
            for b in range(k):
                for d in range(k):
                    information[u, b, d] -= C[u, 0, b] * C[u, 0, d] + C[u, 1, b] * C[u, 1, d] + C[u, 2, b] * C[u, 2, d]
            for b in range(k):
                w2 = C[u, 2, b] / l22
                w1 = (C[u, 1, b] - l21 * w2) / l11
                w0 = (C[u, 0, b] - l10 * w1 - l20 * w2) / l00
                C[u, 0, b], C[u, 1, b], C[u, 2, b] = -w0 * free[p, 0], -w1 * free[p, 1], -w2 * free[p, 2]
            for r in range(ray_start[p] - base, ray_start[p + 1] - base):
                for i in range(m):
                    for b in range(k):
                        t[i, b] = B[r, i, 0] * C[u, 0, b] + B[r, i, 1] * C[u, 1, b] + B[r, i, 2] * C[u, 2, b]
                add_products(A, r, t, column, part_size, part_start, x, u * k)
