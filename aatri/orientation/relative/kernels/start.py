"""Start of pairs from parallel images, compiled.

Both images look the same way, the right one turned by kappa about the common axis. With q = (x, y) / c as complex
numbers, points of equal depth obey q1 = a q2 + t, a = s exp(i kappa). Robustly fitted (weights 1 / |residual|), it
gives R = Rz(kappa) and a base along t.

Source: docs/formulas.md 3.3.
"""

import numpy as np
from numba import njit

from aatri.adjustment.kernels.small import OPTIONS, median

FITS = 6
"""Reweighted fits."""


@njit("void(int64, int64, int64[::1], float64[:,::1], boolean[::1], float64[:,:,::1])", **OPTIONS)
def parallel_starts(first, last, start, q, chosen, pose):
    """Fill R and b of the pairs first ... last - 1.

    Parameters
    ----------
    start : (n_pairs + 1,) int64
        First point of each pair.
    q : (n, 4) float64
        x / c and y / c in the left and in the right image.
    chosen : (n_pairs,) bool
    pose : (n_pairs, 3, 4) float64
        See `sampson`; filled in.
    """
    most = 0
    for p in range(first, last):
        most = max(most, start[p + 1] - start[p])
    weight, size, m, d = np.empty(most), np.empty(most), np.empty(4), np.empty(4)
    for p in range(first, last):
        i, n = start[p], start[p + 1] - start[p]
        re, im = 1.0, 0.0
        if not chosen[p]:
            continue
        for k in range(n):
            weight[k] = 1.0
        for _ in range(FITS):
            total, square, re, im = 0.0, 0.0, 0.0, 0.0
            for j in range(4):
                m[j] = 0.0
            for k in range(n):
                total += weight[k]
                for j in range(4):
                    m[j] += weight[k] * q[i + k, j]
            for j in range(4):
                m[j] /= total
            for k in range(n):
                for j in range(4):
                    d[j] = q[i + k, j] - m[j]
                re += weight[k] * (d[0] * d[2] + d[1] * d[3])
                im += weight[k] * (d[1] * d[2] - d[0] * d[3])
                square += weight[k] * (d[2] * d[2] + d[3] * d[3])
            re, im = re / max(square, 1e-300), im / max(square, 1e-300)
            for k in range(n):
                for j in range(4):
                    d[j] = q[i + k, j] - m[j]
                weight[k] = np.sqrt((d[0] - re * d[2] + im * d[3]) ** 2 + (d[1] - re * d[3] - im * d[2]) ** 2)
                size[k] = weight[k]
            floor = 1e-3 * max(median(size, n), 1e-9)
            for k in range(n):
                weight[k] = 1.0 / max(weight[k], floor)
        length = np.sqrt(re * re + im * im)
        if length > 0.0:
            re, im = re / max(length, 1e-300), im / max(length, 1e-300)
        else:
            re, im = 1.0, 0.0
        t0, t1 = m[0] - re * m[2] + im * m[3], m[1] - re * m[3] - im * m[2]
        length = np.sqrt(t0 * t0 + t1 * t1)
        for k in range(3):
            for j in range(4):
                pose[p, k, j] = 0.0
        pose[p, 0, 0], pose[p, 0, 1], pose[p, 1, 0], pose[p, 1, 1], pose[p, 2, 2] = re, -im, im, re, 1.0
        pose[p, 0, 3] = t0 / length if length > 1e-12 else 1.0
        pose[p, 1, 3] = t1 / length if length > 1e-12 else 0.0
