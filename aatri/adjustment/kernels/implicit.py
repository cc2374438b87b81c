"""The reduced normal matrix applied to a vector, ray by ray, without forming it.

    S x = sum over blocks of A'(t - B L^-T w),     t = A x,   w = L^-1 B't,     L L' = sum B'B + D0

With t = v and w = L^-1 (B'v + h0), which elimination has left, the same sum is the gradient.
"""

from numba import njit

from aatri.adjustment.kernels.small import OPTIONS

_COMMON = "int64, int64, int64, int64[::1], float64[:,:,::1], float64[:,:,::1], int64[:,::1], int32[::1], int32[::1]"


@njit(f"void({_COMMON}, float64[::1], float64[:,::1], float64[:,::1], float64[:,::1], float64[:,::1])", **OPTIONS)
def along_rays(p0, p1, base, ray_start, A, B, column, part_size, part_start, x, free, Ls, t, w):
    """t = A x and w = L^-1 B't of the blocks p0 ... p1 - 1.

    Parameters
    ----------
    column : (n, parts) int64
        First kept column of each part, -1 where it is held.
    part_size, part_start : (parts,) int32
    x : (n_kept,) float64
    free, Ls : (n_blocks, 3), (n_blocks, 6) float64
    t : (n, m) float64; w : (n_blocks, 3) float64
        Filled in.
    """
    for p in range(p0, p1):
        s0, s1, s2 = 0.0, 0.0, 0.0
        for r in range(ray_start[p] - base, ray_start[p + 1] - base):
            for i in range(A.shape[1]):
                s = 0.0
                for part in range(len(part_size)):
                    c, first = column[r, part], part_start[part]
                    if c >= 0:
                        for a in range(part_size[part]):
                            s += A[r, i, first + a] * x[c + a]
                t[r, i] = s
                s0 += B[r, i, 0] * s
                s1 += B[r, i, 1] * s
                s2 += B[r, i, 2] * s
        w0 = s0 * free[p, 0] / Ls[p, 0]
        w1 = (s1 * free[p, 1] - Ls[p, 1] * w0) / Ls[p, 3]
        w[p, 0], w[p, 1] = w0, w1
        w[p, 2] = (s2 * free[p, 2] - Ls[p, 2] * w0 - Ls[p, 4] * w1) / Ls[p, 5]


@njit(f"void({_COMMON}, float64[:,::1], float64[:,::1], float64[:,::1], float64[:,::1], float64[::1])", **OPTIONS)
def onto_kept(p0, p1, base, ray_start, A, B, column, part_size, part_start, free, Ls, t, w, total):
    """Add A'(t - B L^-T w) of the blocks p0 ... p1 - 1 to `total`, (n_kept,); the rest as in `along_rays`."""
    for p in range(p0, p1):
        z2 = w[p, 2] / Ls[p, 5]
        z1 = (w[p, 1] - Ls[p, 4] * z2) / Ls[p, 3]
        z0 = (w[p, 0] - Ls[p, 1] * z1 - Ls[p, 2] * z2) / Ls[p, 0]
        z0, z1, z2 = z0 * free[p, 0], z1 * free[p, 1], z2 * free[p, 2]
        for r in range(ray_start[p] - base, ray_start[p + 1] - base):
            for i in range(A.shape[1]):
                s = t[r, i] - B[r, i, 0] * z0 - B[r, i, 1] * z1 - B[r, i, 2] * z2
                for part in range(len(part_size)):
                    c, first = column[r, part], part_start[part]
                    if c >= 0:
                        for a in range(part_size[part]):
                            total[c + a] += A[r, i, first + a] * s
