"""How far residuals are from what the linear model foretold: the compiled part."""

import numpy as np
from numba import njit

SIGNATURE = (
    "float64(int64, int64, int64, int64[::1], float64[:,::1], float64[:,:,::1], float64[:,:,::1], int64[:,::1], "
    "int32[::1], int32[::1], float64[::1], float64[:,::1], float64[:,::1], boolean[::1])"
)


@njit(SIGNATURE, nogil=True, cache=True)
def largest_departure(p0, p1, base, ray_start, v, A, B, column, part_size, part_start, dx, dy, after, left_out):
    """Largest |v + A dx + B dy - after| of the rays of the blocks p0 ... p1 - 1; NaN if one of them is.

    Parameters
    ----------
    base : int
        Number of the ray in row 0 of v, A, B, column and after.
    ray_start : (n_blocks + 1,) int64
    v, after : (n, m) float64
        Residuals before and after the step.
    A, B : (n, m, columns), (n, m, 3) float64
    column : (n, parts) int64
        First kept column of each part, -1 where it is held.
    part_size, part_start : (parts,) int32
    dx, dy : (n_kept,), (n_blocks, 3) float64
    left_out : (n_blocks,) bool
    """
    largest = 0.0
    for p in range(p0, p1):
        if left_out[p]:
            continue
        for r in range(ray_start[p] - base, ray_start[p + 1] - base):
            for i in range(v.shape[1]):
                s = v[r, i] + B[r, i, 0] * dy[p, 0] + B[r, i, 1] * dy[p, 1] + B[r, i, 2] * dy[p, 2] - after[r, i]
                for part in range(len(part_size)):
                    c, first = column[r, part], part_start[part]
                    if c >= 0:
                        for a in range(part_size[part]):
                            s += A[r, i, first + a] * dx[c + a]
                if not np.abs(s) <= largest:
                    largest = np.abs(s)
                    if np.isnan(s):
                        return s
    return largest
