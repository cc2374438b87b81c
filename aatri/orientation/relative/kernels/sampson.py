"""One undamped adjustment of the Sampson distances of a pair, compiled.

The equations are those of `geometry.coplanarity.sampson`, the steps and their end those of `adjustment.dense.adjust`
without damping. What needs damping, is not clearly determined or not finite is left to the NumPy form: 0 iterations.

A pair is held in three arrays: `pose` (3, 4), the rotation R and in its last column the base b; `rays` (n, 10), the
columns (x, y, -c) of the left and the right image and the variances of x1, y1, x2, y2; `work` (n, 9), per point the
distance v, its five derivatives, its test statistic and redundancy number, and the standard deviation of its
y-parallax, s_F / |dF/d(x2, y2)|.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from aatri.adjustment.kernels.small import CLEARLY_POSED, OPTIONS, inverse_root, newton_step
from aatri.geometry.kernels.rotations import turn

TOLERANCE = 1e-3
"""Bound of the Newton decrement, as of `adjustment.dense.adjust`."""

ROUNDING = 1e-10
"""Relative increase of the cost that rounding may cause, as of `adjustment.stepping.damping`."""


@njit("void(float64[:,::1], float64[:,::1], float64[:,:,::1])", **OPTIONS)
def epipolar(pose, T, M):
    """Fill T with b and its tangents (as `geometry.vectors.tangents`), M with E = -[b]x R and its five derivatives.

    Every column of these matrices is a cross product x X t: x a column of R, or of [e_k]x R for the derivative by the
    k-th rotation; t the base, or a tangent for the derivative by its turn.
    """
    x, main, square = np.empty(3), 0, 0.0
    for i in range(3):
        T[0, i] = pose[i, 3]
        if abs(T[0, i]) > abs(T[0, main]):
            main = i
    for i in range(3):
        T[1, i] = (1.0 if i == (main + 1) % 3 else 0.0) - T[0, i] * pose[(main + 1) % 3, 3]
        square += T[1, i] * T[1, i]
    for i in range(3):
        T[1, i] /= np.sqrt(square)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        T[2, i] = (T[0, j] * T[1, k] - T[0, k] * T[1, j]) * (1.0 if T[0, main] > 0.0 else -1.0)
    for u in range(6):
        t = max(u - 3, 0)
        for column in range(3):
            for i in range(3):
                x[i] = pose[i, column]
            if 1 <= u <= 3:
                x[u - 1], x[u % 3], x[(u + 1) % 3] = 0.0, -x[(u + 1) % 3], x[u % 3]
            for i in range(3):
                j, k = (i + 1) % 3, (i + 2) % 3
                M[u, i, column] = x[j] * T[t, k] - x[k] * T[t, j]


@njit("float64(float64[:,::1], float64[:,::1], boolean[::1], float64[:,::1], float64[:,::1], float64[:,::1], float64[::1])", **OPTIONS)  # fmt: skip
def linearise(pose, rays, active, work, T, N, g):
    """Fill v, its derivatives J and the sigma of the parallax of all points, and N = J'J (lower triangle), g = J'v of the active ones.

    Returns
    -------
    float
        v'v of the active points.
    """
    M, F, G, cost = np.empty((6, 3, 3)), np.empty(6), np.empty((6, 4)), 0.0
    epipolar(pose, T, M)
    for i in range(5):
        g[i] = 0.0
        for j in range(5):
            N[i, j] = 0.0
    for n in range(len(rays)):
        for u in range(6):
            F[u] = 0.0
            for i in range(3):
                of_left = M[u, i, 0] * rays[n, 3] + M[u, i, 1] * rays[n, 4] + M[u, i, 2] * rays[n, 5]
                F[u] += rays[n, i] * of_left
                if i < 2:
                    G[u, i] = of_left
                    G[u, 2 + i] = M[u, 0, i] * rays[n, 0] + M[u, 1, i] * rays[n, 1] + M[u, 2, i] * rays[n, 2]
        square = 0.0
        for i in range(4):
            square += rays[n, 6 + i] * G[0, i] * G[0, i]
        s = np.sqrt(square)
        v = -F[0] / s
        work[n, 0], work[n, 8] = v, s / np.sqrt(G[0, 2] * G[0, 2] + G[0, 3] * G[0, 3])
        for u in range(1, 6):
            ds = 0.0
            for i in range(4):
                ds += rays[n, 6 + i] * G[0, i] * G[u, i]
            work[n, u] = -(F[u] + v * ds / s) / s
        if active[n]:
            cost += v * v
            for i in range(5):
                g[i] += work[n, 1 + i] * v
                for j in range(i + 1):
                    N[i, j] += work[n, 1 + i] * work[n, 1 + j]
    return cost


@njit("int64(float64[:,::1], float64[:,::1], boolean[::1], int64, float64[:,::1], float64[:,::1])", **OPTIONS)
def adjust(pose, rays, active, max_iterations, work, W):
    """Adjust the pose in place with the active points.

    Parameters
    ----------
    work : (n, 9) float64
        v and J are filled in, of all points, at the solution.
    W : (5, 5) float64
        Filled in: the covariance of the unknowns is W'W.

    Returns
    -------
    int
        Iterations; 0 if the pair is left to the NumPy form.
    """
    N, g, dx, T, R = np.empty((5, 5)), np.empty(5), np.empty(5), np.empty((3, 3)), np.empty((3, 3))
    cost, decrement = np.inf, np.inf
    for iteration in range(max_iterations + 1):
        after = linearise(pose, rays, active, work, T, N, g)
        if not (after < np.inf and inverse_root(N, W) > CLEARLY_POSED):
            return 0
        if decrement <= TOLERANCE:
            return iteration
        if not after <= cost * (1.0 + ROUNDING):
            return 0
        cost, decrement = after, newton_step(W, g, dx)
        square = 0.0
        for i in range(3):
            T[0, i] += T[1, i] * dx[3] + T[2, i] * dx[4]
            square += T[0, i] * T[0, i]
            for j in range(3):
                R[i, j] = pose[i, j]
        turn(dx[0], dx[1], dx[2], R)
        for i in range(3):
            pose[i, 3] = T[0, i] / np.sqrt(square)
            for j in range(3):
                pose[i, j] = R[i, j]
    return 0
