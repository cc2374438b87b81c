"""Scale of every joint of two models, compiled; the method is that of `strips.joints`.

The problem is linear: v = A x - y of the common points, all whitened, and v = x of the latent orientation errors, the
unknowns but the last one, which is the logarithm of the scale; its column of A is 1 / sigma.
"""

import numpy as np
from numba import njit

from aatri.adjustment.kernels.small import DETERMINED, OPTIONS, inverse_root, leverage, median, newton_step
from aatri.adjustment.kernels.snooping import UNCONTROLLED, count, worst_and_best

CHECKED = 3
"""With fewer points a wrong one cannot be told."""


@njit("boolean(float64[:,::1], float64[::1], boolean[::1], float64[::1], float64[:,::1], float64[:,::1])", **OPTIONS)
def fit(A, y, active, x, W, work):
    """Adjust x with the active points and fill residual, redundancy number and test of all; False if not determined.

    Parameters
    ----------
    W : (u, u) float64
        Filled in: the covariance of x is W'W.
    work : (n, 3) float64
        Filled in; 1 + j'Qj and a prediction's test for points not active, NaN where uncontrolled.
    """
    u = len(x)
    N, g, dx = np.zeros((u, u)), np.empty(u), np.empty(u)
    for step in range(2):
        for i in range(u):
            g[i] = x[i] if i < u - 1 else 0.0
            if step == 0 and i < u - 1:
                N[i, i] = 1.0
        for k in range(len(y)):
            if active[k]:
                v = -y[k]
                for i in range(u):
                    v += A[k, i] * x[i]
                for i in range(u):
                    g[i] += A[k, i] * v
                    if step == 0:
                        for j in range(i + 1):
                            N[i, j] += A[k, i] * A[k, j]
        if step == 0 and not inverse_root(N, W) > DETERMINED:
            return False
        newton_step(W, g, dx)
        for i in range(u):
            x[i] += dx[i]
    for k in range(len(y)):
        v = -y[k]
        for i in range(u):
            v += A[k, i] * x[i]
        share = leverage(W, A[k])
        r = 1.0 - share if active[k] else 1.0 + share
        work[k, 0], work[k, 1] = v, r if r > UNCONTROLLED else np.nan
        work[k, 2] = abs(v) / np.sqrt(work[k, 1])
    return True


@njit("void(float64[:,::1], float64[::1], float64, boolean[::1], float64[::1], float64[::1], float64[::1])", **OPTIONS)
def begin(A, y, limit, active, x, deviation, work):
    """Fill x with the median scale, and `active` with the points near it if they are more than half, else with all."""
    n, u, near = len(y), len(x), 0
    for k in range(n):
        work[k] = y[k] / A[k, u - 1]
    middle = median(work, n)
    for i in range(u):
        x[i] = middle if i == u - 1 else 0.0
    for k in range(n):
        deviation[k] = abs(y[k] / A[k, u - 1] - middle)
        work[k] = deviation[k]
    bound = 5.0 * median(work, n)
    for k in range(n):
        square = 1.0
        for i in range(u - 1):
            square += A[k, i] * A[k, i]
        active[k] = deviation[k] <= max(2.0 * limit * np.sqrt(square) / A[k, u - 1], bound)
        near += active[k]
    for k in range(n):
        active[k] = active[k] or n < CHECKED or not near > n / 2


@njit(
    "void(int64, int64, int64[::1], float64[:,::1], float64[::1], float64, float64[:,::1], float64[::1], boolean[::1], boolean[::1], float64[:,::1])",
    **OPTIONS,
)
def join(first, last, start, A, y, limit, x, sigma, done, active, work):
    """Adjust the joints first ... last - 1 with data snooping.

    Parameters
    ----------
    start : (n_joints + 1,) int64
        First common point of each joint.
    A, y : (n, 11), (n,) float64
        Whitened derivatives and observed logarithms of the scale.
    limit : float
    x : (n_joints, 11) float64
    sigma : (n_joints,) float64
        Standard deviation of the last unknown.
    done : (n_joints,) bool
        False where the points do not determine the scale; without points too.
    active : (n,) bool
    work : (n, 3) float64
        See `fit`.
    """
    most = 0
    for p in range(first, last):
        most = max(most, start[p + 1] - start[p])
    one, two, W = np.empty(most), np.empty(most), np.empty((A.shape[1], A.shape[1]))
    everything = np.empty(most, dtype=np.bool_)
    for k in range(most):
        everything[k] = True
    for p in range(first, last):
        i, j = start[p], start[p + 1]
        n, trial = j - i, -1
        if n == 0:
            continue
        of_joint, observed, used, here = A[i:j], y[i:j], active[i:j], work[i:j]
        share = min(0.5, (n - 2.5) / n) * n if n >= CHECKED else 0.0
        begin(of_joint, observed, limit, used, x[p], one, two)
        for _ in range(2 * n + 2):
            done[p] = fit(of_joint, observed, used, x[p], W, here)
            if not done[p] or trial == n:
                break
            if trial >= 0 and not here[trial, 2] < limit:
                used[trial], trial = False, n  # adjusted once more without it, and for good
                continue
            worst, best = worst_and_best(everything, used, here, 2, limit)
            above, trial = worst >= 0 and here[worst, 2] > limit, -1
            if above and n - count(used) < share:
                used[worst] = False
            elif best >= 0 and not above:
                used[best], trial = True, best
            else:
                break
        sigma[p] = W[len(W) - 1, len(W) - 1]
        done[p] = done[p] and x[p, len(W) - 1] < np.inf
