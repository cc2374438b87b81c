"""Similarities with the least sum of distances, of many pairs of point sets, compiled; the formulas are those of
`geometry.similarity.robust_closed_form`.
"""

import numpy as np
from numba import njit

from aatri.adjustment.kernels.small import OPTIONS, median


@njit("float64(float64[:,:])", **OPTIONS)
def determinant(A):
    """Of a 3 x 3 matrix; np.linalg.det takes seconds to compile."""
    s = A[0, 0] * (A[1, 1] * A[2, 2] - A[1, 2] * A[2, 1]) - A[0, 1] * (A[1, 0] * A[2, 2] - A[1, 2] * A[2, 0])
    return s + A[0, 2] * (A[1, 0] * A[2, 1] - A[1, 1] * A[2, 0])


@njit(
    "void(int64[::1], float64[:,::1], float64[:,::1], int64, float64[:,::1], float64[::1], float64[:,:,::1], float64[::1])",
    **OPTIONS,
)
def robust_similarities(start, all_x, all_X, iterations, shift, scale, rotation, all_distance):
    """Fill in X = shift + scale R x of every pair and the distances of its points.

    Parameters
    ----------
    start : (n_pairs + 1,) int64
        First point of each pair, which has three or more.
    all_x, all_X : (n, 3) float64
        Source and target.
    iterations : int
        At most, after the first with equal weights.
    shift, scale, rotation : (n_pairs, 3), (n_pairs,), (n_pairs, 3, 3) float64
    all_distance : (n,) float64
    """
    most = 0
    for p in range(len(start) - 1):
        most = max(most, start[p + 1] - start[p])
    w, work, H = np.empty(most), np.empty(most), np.empty((3, 3))
    x0, X0, R, flip = np.empty(3), np.empty(3), np.empty((3, 3)), np.ones(3)
    for p in range(len(start) - 1):
        x, X = all_x[start[p] : start[p + 1]], all_X[start[p] : start[p + 1]]
        distance, n = all_distance[start[p] : start[p + 1]], start[p + 1] - start[p]
        least = 0.0
        for a in range(3):
            X0[a] = 0.0
            for k in range(n):
                X0[a] += X[k, a] / n
        for k in range(n):
            least = max(least, (X[k, 0] - X0[0]) ** 2 + (X[k, 1] - X0[1]) ** 2 + (X[k, 2] - X0[2]) ** 2)
        least = 1e-9 * np.sqrt(least) + 2.2250738585072014e-308
        for iteration in range(iterations + 1):
            total = 0.0
            for a in range(3):
                x0[a], X0[a] = 0.0, 0.0
                for b in range(3):
                    H[a, b] = 0.0
            for k in range(n):
                w[k] = 1.0 / max(distance[k], least) if iteration else 1.0
                total += w[k]
                for a in range(3):
                    x0[a] += w[k] * x[k, a]
                    X0[a] += w[k] * X[k, a]
            for a in range(3):
                x0[a] /= total
                X0[a] /= total
            square = 0.0
            for k in range(n):
                for a in range(3):
                    d = x[k, a] - x0[a]
                    square += w[k] * d * d
                    for b in range(3):
                        H[b, a] += w[k] * (X[k, b] - X0[b]) * d
            u, _, vt = np.linalg.svd(H)
            flip[2] = np.sign(determinant(u) * determinant(vt))
            along = 0.0
            for a in range(3):
                for b in range(3):
                    s = 0.0
                    for c in range(3):
                        s += u[a, c] * flip[c] * vt[c, b]
                    R[a, b] = s
                    along += s * H[a, b]
            scale[p] = along / square
            for a in range(3):
                shift[p, a] = X0[a] - scale[p] * (R[a, 0] * x0[0] + R[a, 1] * x0[1] + R[a, 2] * x0[2])
            change = 0.0
            for k in range(n):
                s = 0.0
                for a in range(3):
                    moved = R[a, 0] * x[k, 0] + R[a, 1] * x[k, 1] + R[a, 2] * x[k, 2]
                    s += (shift[p, a] + scale[p] * moved - X[k, a]) ** 2
                s = np.sqrt(s)
                if iteration:
                    change = max(change, abs(s - distance[k]))
                distance[k] = s
                work[k] = s
            if iteration and change <= 1e-3 * max(median(work, n), least):
                break
        for a in range(3):
            for b in range(3):
                rotation[p, a, b] = R[a, b]
