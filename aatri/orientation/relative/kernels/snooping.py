"""Data snooping of pairs, compiled.

With many points the largest gross errors go several at a time before the snooping, which rejects the worst point while
its test statistic exceeds the limit, and tests those rejected for re-admission.

`pose`, `rays` and `work` are those of `sampson`; `active` are the points used.
"""

import numpy as np
from numba import njit

from aatri.adjustment.kernels.small import OPTIONS, leverage
from aatri.adjustment.kernels.snooping import UNCONTROLLED, count, worst_and_best
from aatri.orientation.relative.kernels.sampson import adjust, assign

MANY = 20
"""With more points, gross errors are first rejected several at a time."""

SNOOPED = 7
"""With fewer points an error is seen, but not located: all are used."""

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


@njit(
    "void(int64, int64, int64[::1], float64[:,::1], boolean[::1], float64, int64, float64[:,:,::1], float64[:,:,::1], int64[::1], boolean[::1], boolean[::1], float64[:,::1])",
    **OPTIONS,
)
def snoop(
    first, last, start, all_rays, chosen, limit, max_iterations, pose, W, iterations, all_inside, all_active, all_work
):
    """Adjust the chosen pairs among first ... last - 1 with data snooping.

    Parameters
    ----------
    start : (n_pairs + 1,) int64
        First point of each pair.
    all_rays : (n, 10) float64
        See `sampson`.
    limit, max_iterations
        Of the method.
    pose : (n_pairs, 3, 4) float64
        Start; adjusted.
    W : (n_pairs, 5, 5) float64
        Filled in: the covariance of the unknowns is W'W.
    iterations : (n_pairs,) int64
        Of the last adjustment; as of `sampson.adjust`.
    all_inside : (n,) bool
        Points that may be used.
    all_active : (n,) bool
        Points to begin with; changed.
    all_work : (n, 9) float64
        See `sampson`, at the solution.
    """
    before = np.empty((3, 4))
    for p in range(first, last):
        if not chosen[p]:
            continue
        i, j = start[p], start[p + 1]
        rays, inside, active, work = all_rays[i:j], all_inside[i:j], all_active[i:j], all_work[i:j]
        n, used, cleaned, trial, most, iterations[p] = count(inside), count(active), 0, -1, -1.0, 0
        if n < SNOOPED:
            for k in range(len(rays)):
                active[k] = inside[k]
            iterations[p] = adjust(pose[p], rays, active, max_iterations, work, W[p])
            statistics(work, W[p], active)
            continue
        for _ in range(ROUNDS + 2 * n + 2):
            cleaning = most < 0.0 and cleaned < ROUNDS and used > MANY
            if most < 0.0 and not cleaning:
                most = min(max(0.4 * n, 0.1 * n + n - used), n - 6.5) / n * n
            done = adjust(pose[p], rays, active, 0 if trial == n else max_iterations, work, W[p])
            if done <= 0 and trial != n:
                iterations[p] = done
                break
            statistics(work, W[p], active)
            if trial == n:
                break
            if cleaning:
                cleaned = cleaned + 1 if clean_coarsely(inside, active, work, limit) else ROUNDS
                used = count(active)
                continue
            if trial >= 0 and not work[trial, 6] < limit:
                active[trial], trial = False, n  # back to the solution without it
                assign(before, pose[p])
                continue
            trial, iterations[p] = -1, done
            worst, best = worst_and_best(inside, active, work, 6, limit)
            above = worst >= 0 and work[worst, 6] > limit
            if above and n - used < most:
                active[worst] = False
                used -= 1
            elif best >= 0 and not above:
                assign(pose[p], before)
                active[best], trial = True, best
                used += 1
            else:
                break
