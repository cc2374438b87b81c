"""Adjustment of the Sampson distances of a pair, compiled; the equations are those of `geometry.coplanarity.sampson`.

A Gauss-Newton step solves J'J dx = -J'v; if it does not lower the cost, Levenberg-Marquardt damping takes over:

    (J'J + lambda D^2) dx = -J'v,     D_k = largest norm of column k so far, fading
    (J'J + lambda D^2) a  = -J'v'',   v'' = second derivative of v along dx, by a difference

A damped step follows the curved valley, dx + a/2; it is refused where a component of D a exceeds 0.375 |D dx|: the
linear model does not hold that far. Converged when the Newton decrement sqrt(dx'J'J dx), which bounds the step of every
unknown by as much of its standard deviation, is at most `TOLERANCE`; the last step is applied.

A pair is held in three arrays: `pose` (3, 4), the rotation R and in its last column the base b; `rays` (n, 10), the
columns (x, y, -c) of the left and the right image and the variances of x1, y1, x2, y2; `work` (n, 9), per point the
distance v, its five derivatives, its test statistic and redundancy number, and the standard deviation of its
y-parallax, s_F / |dF/d(x2, y2)|.

Source: More 1978, The Levenberg-Marquardt algorithm (D); Transtrum & Sethna 2012, Improvements to the
Levenberg-Marquardt algorithm (a).
"""

import numpy as np
from numba import njit

from aatri.adjustment.kernels.small import DETERMINED, OPTIONS, inverse_root, newton_step
from aatri.geometry.kernels.rotations import turn

TOLERANCE = 1e-3
"""Bound of the Newton decrement: a thousandth of the standard deviations."""

OPEN = -1
"""Instead of iterations, where the points leave something of the orientation open."""

ROUNDING, FIRST, GOOD, SHRINK = 1e-10, 1e-3, 0.75, 0.03
"""Of the damping, as of `adjustment.stepping.damping`."""

FADING, BEND, AHEAD = 0.8, 0.375, 0.1
"""Share of D that is kept from step to step, bound of |D a| over |D dx|, and the share of dx at which v'' is taken."""


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


@njit(
    "float64(float64[:,::1], float64[:,::1], boolean[::1], float64[:,::1], float64[:,::1], float64[:,::1], float64[::1])",
    **OPTIONS,
)
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


@njit("void(float64[:,::1], float64[:,::1])", **OPTIONS)
def assign(values, target):
    """Copy a table."""
    for i in range(len(values)):
        for j in range(values.shape[1]):
            target[i, j] = values[i, j]


@njit("void(float64[:,::1], float64[:,::1], float64[::1], float64, float64[:,::1])", **OPTIONS)
def move(pose, T, dx, share, to_pose):
    """Fill `to_pose` with the pose after a share of the step dx."""
    R, square = np.empty((3, 3)), 0.0
    for i in range(3):
        to_pose[i, 3] = T[0, i] + share * (T[1, i] * dx[3] + T[2, i] * dx[4])
        square += to_pose[i, 3] * to_pose[i, 3]
        for j in range(3):
            R[i, j] = pose[i, j]
    turn(share * dx[0], share * dx[1], share * dx[2], R)
    for i in range(3):
        to_pose[i, 3] /= np.sqrt(square)
        for j in range(3):
            to_pose[i, j] = R[i, j]


@njit(
    "boolean(float64[:,::1], float64[:,::1], boolean[::1], float64[:,::1], float64[::1], float64[::1], float64[::1])",
    **OPTIONS,
)
def bend(ahead, work, active, W, scale, h, dx):
    """Add half of its acceleration to a damped step dx, from the distances `ahead` on it; False if it bends too much."""
    acceleration, of_step, largest = np.empty(5), 0.0, 0.0
    for i in range(5):
        h[i] = 0.0
    for n in range(len(work)):
        if active[n]:
            second = (ahead[n, 0] - work[n, 0]) / AHEAD
            for i in range(5):
                second -= work[n, 1 + i] * dx[i]
            for i in range(5):
                h[i] += work[n, 1 + i] * second * 2.0 / AHEAD
    newton_step(W, h, acceleration)
    for i in range(5):
        of_step += (scale[i] * dx[i]) ** 2
        largest = max(largest, abs(scale[i] * acceleration[i]))
        dx[i] += 0.5 * acceleration[i]
    return largest <= BEND * np.sqrt(of_step)


@njit("int64(float64[:,::1], float64[:,::1], boolean[::1], int64, float64[:,::1], float64[:,::1])", **OPTIONS)
def adjust(pose, rays, active, max_iterations, work, W):
    """Adjust the pose in place with the active points.

    Parameters
    ----------
    max_iterations : int
        With 0, `work` and W are filled in at the pose as it is, and 0 is returned.
    work : (n, 9) float64
        v, J and the sigma of the parallax are filled in, of all points, at the solution.
    W : (5, 5) float64
        Filled in: the covariance of the unknowns is W'W.

    Returns
    -------
    int
        Iterations; 0 if they do not converge, `OPEN` if the normal equations are singular.
    """
    N, g, M, h, T, S = (
        np.empty((5, 5)),
        np.empty((1, 5)),
        np.empty((5, 5)),
        np.empty((1, 5)),
        np.empty((3, 3)),
        np.empty((3, 3)),
    )
    trial, there, dx, scale = np.empty((3, 4)), np.empty((len(rays), 9)), np.empty(5), np.zeros(5)
    damping, growth, threshold, iteration, ahead = 0.0, 2.0, 2.0 * FIRST, 0, False
    cost, predicted, decrement = np.inf, 1.0, np.inf
    assign(pose, trial)
    while True:
        after = linearise(trial, rays, active, there, S, M, h[0])
        if ahead and after < np.inf and bend(there, work, active, W, scale, h[0], dx):
            ahead = False
            move(pose, T, dx, 1.0, trial)
            continue
        if not ahead and damping == 0.0 and decrement <= TOLERANCE and after < np.inf:
            assign(trial, pose)
            assign(there, work)
            return iteration if inverse_root(M, W) > DETERMINED else OPEN
        if not ahead and after <= cost * (1.0 + ROUNDING) and after < np.inf:
            gain = (cost - after) / predicted if predicted > ROUNDING * cost else 1.0
            if damping < threshold and gain > GOOD:
                damping = 0.0
            damping, growth = damping * max(1.0 / 3.0, 1.0 - (2.0 * min(max(gain, 0.0), 1.0) - 1.0) ** 3), 2.0
            cost = after
            assign(trial, pose)
            assign(there, work)
            assign(M, N)
            assign(h, g)
            assign(S, T)
            for i in range(5):
                scale[i] = max(FADING * scale[i], np.sqrt(N[i, i]))
        elif iteration == 0:
            return 0
        elif damping == 0.0:
            damping, growth, threshold = min(FIRST, threshold), 2.0, SHRINK * threshold
        else:
            damping, growth = damping * growth, 2.0 * growth
        iteration += 1
        assign(N, M)
        for i in range(5):
            M[i, i] += damping * scale[i] * scale[i]
        if not inverse_root(M, W) > DETERMINED:
            return OPEN
        if iteration > max_iterations:
            return 0
        decrement = newton_step(W, g[0], dx)
        predicted = decrement * decrement
        for i in range(5):
            predicted += damping * (scale[i] * dx[i]) ** 2
        ahead = damping > 0.0 and predicted > ROUNDING * cost
        move(pose, T, dx, AHEAD if ahead else 1.0, trial)
