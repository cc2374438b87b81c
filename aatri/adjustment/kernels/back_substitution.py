"""Back substitution of eliminated blocks, from the step of the kept unknowns."""

from numba import njit

from aatri.adjustment.kernels.small import OPTIONS

_SUBSTITUTE = (
    "void(int64, int64, int64, int64[::1], float64[:,:,::1], float64[:,:,::1], int64[:,::1], int32[::1], int32[::1], "
    "float64[::1], float64[:,::1], float64[:,::1], float64[:,::1], float64[:,::1])"
)


@njit(_SUBSTITUTE, **OPTIONS)
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
