"""Data snooping of one pair, compiled: the rules of `pair_adjustment` and `adjustment.statistics.snooping`.

`pose`, `rays` and `work` are those of `sampson`; `active` are the points used.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from aatri.adjustment.kernels.small import OPTIONS, leverage
from aatri.adjustment.kernels.snooping import UNCONTROLLED, count, worst_and_best
from aatri.orientation.relative.kernels.sampson import adjust

MANY = 20
"""With more points, gross errors are first rejected several at a time."""

ROUNDS = 10
"""Most rounds of that: points near the bound may come and go."""


@njit("void(float64[:,::1], float64[:,::1], boolean[::1])", **OPTIONS)
def statistics(work, W, active):
    """Fill r = 1 - j'Qj of an active point, 1 + j'Qj of another, and the test |v| / sqrt(r); NaN where open."""
    for k in range(len(work)):
        share = leverage(W, work[k, 1:6])
        r = 1.0 - share if active[k] else 1.0 + share
        work[k, 7] = r if r > UNCONTROLLED else np.nan
        work[k, 6] = abs(work[k, 0]) / np.sqrt(work[k, 7])


@njit("boolean(boolean[::1], boolean[::1], float64[:,::1], float64)", **OPTIONS)
def clean_coarsely(inside, active, work, limit):
    """Take out what is beyond half of the largest test statistic; False if that changes nothing or leaves too few."""
    bound, kept, same = 2 * limit, 0, True
    for k in range(len(work)):
        if active[k] and 0.5 * work[k, 6] > bound:
            bound = 0.5 * work[k, 6]
    for k in range(len(work)):
        keep = inside[k] and work[k, 6] <= bound
        kept += keep
        same = same and keep == active[k]
    if kept < MANY or same:
        return False
    for k in range(len(work)):
        active[k] = inside[k] and work[k, 6] <= bound
    return True


@njit("void(float64[:,::1], float64[:,::1], float64[:,::1], float64[:,::1])", **OPTIONS)
def copy(pose, W, to_pose, to_W):
    """Copy a solution: orientation and root of the covariance."""
    for i in range(5):
        for j in range(5):
            to_W[i, j] = W[i, j]
            if i < 3 and j < 4:
                to_pose[i, j] = pose[i, j]


@njit("int64(float64[:,::1], float64[:,::1], boolean[::1], boolean[::1], float64, int64, float64[:,::1], float64[:,::1])", **OPTIONS)  # fmt: skip
def snoop(pose, rays, inside, active, limit, max_iterations, work, W):
    """Adjust the pose in place with data snooping.

    Parameters
    ----------
    inside : (n,) bool
        Points that may be used, seven or more.
    active : (n,) bool
        Points to begin with; changed.
    work : (n, 9) float64
        Room to work in.
    W : (5, 5) float64
        Filled in: the covariance of the unknowns is W'W.

    Returns
    -------
    int
        Iterations of the last adjustment; 0 if the pair is left to the NumPy form.
    """
    n, used, cleaned, trial, most, iterations = count(inside), count(active), 0, -1, -1.0, 0
    pose_before, W_before = np.empty((3, 4)), np.empty((5, 5))
    for _ in range(ROUNDS + 2 * n + 1):
        cleaning = most < 0.0 and cleaned < ROUNDS and used > MANY
        if most < 0.0 and not cleaning:
            most = min(max(0.4 * n, 0.1 * n + n - used), n - 6.5) / n * n
        now = adjust(pose, rays, active, max_iterations, work, W)
        if now == 0:
            return 0
        statistics(work, W, active)
        if cleaning:
            cleaned = cleaned + 1 if clean_coarsely(inside, active, work, limit) else ROUNDS
            used = count(active)
            continue
        if trial >= 0 and not work[trial, 6] < limit:
            active[trial] = False
            copy(pose_before, W_before, pose, W)
            break
        trial, iterations = -1, now
        worst, best = worst_and_best(inside, active, work, 6, limit)
        above = worst >= 0 and work[worst, 6] > limit
        if above and n - used < most:
            active[worst] = False
            used -= 1
        elif best >= 0 and not above:
            copy(pose, W, pose_before, W_before)
            active[best], trial = True, best
            used += 1
        else:
            break
    return iterations
