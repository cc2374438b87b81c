"""Hypotheses of relative orientation, compiled: judged by all points, decomposed, adjusted with the points that fit.

A hypothesis is judged by Cauchy's cost sum log(1 + (v / 3)^2) of the Sampson distances v. With E = -[b]x R of norm
sqrt(2) and t = -b: R = cof(E) - [t]x E; of (R, b) (R, -b) (R', b) (R', -b), R' = cof(E) + [t]x E, that with most points
in front of both images counts; points behind count as gross errors.

`pose` and `rays` are those of `sampson`. Source: Horn 1990, Recovering baseline and orientation from essential matrix.
"""

import numpy as np
from numba import njit

from aatri.adjustment.kernels.small import OPTIONS, select
from aatri.orientation.relative.kernels.sampson import adjust, assign

CAUCHY, BEHIND, FITS = 3.0, 100.0, 3.0
"""Bound of Cauchy's cost; a point behind an image; largest distance of a point that fits: in standard deviations, and of
normal ones 0.3 % are farther; the snooping takes them back."""

ALIKE = 0.02
"""Orientations that differ by less, in rad, are one."""

ITERATIONS = 8
"""Of an adjustment of points that fit."""

QUANTILE, AT_QUANTILE, MOST_SPREAD = 0.3, 0.3853, 6.0
"""The spread of the distances is their quantile over that of |N(0, 1)|, at most so large."""


@njit("float64(float64[:,::1], float64[:,::1], float64, float64[::1])", **OPTIONS)
def judge(E, rays, bound, v):
    """Fill v with the Sampson distances of all points; returns Cauchy's cost, or inf where it exceeds the bound."""
    cost, product = 0.0, 1.0
    for n in range(len(rays)):
        F, square = 0.0, 0.0
        for i in range(3):
            of_left = E[i, 0] * rays[n, 3] + E[i, 1] * rays[n, 4] + E[i, 2] * rays[n, 5]
            F += rays[n, i] * of_left
            if i < 2:
                of_right = E[0, i] * rays[n, 0] + E[1, i] * rays[n, 1] + E[2, i] * rays[n, 2]
                square += rays[n, 6 + i] * of_left * of_left + rays[n, 8 + i] * of_right * of_right
        v[n] = F / np.sqrt(square) if square > 0.0 else BEHIND
        product *= 1.0 + (v[n] / CAUCHY) ** 2
        if product > 1e200:
            cost, product = cost + np.log(product), 1.0
            if cost > bound:
                return np.inf
    cost += np.log(product)
    return cost if cost <= bound else np.inf


@njit("int64(float64[:,::1], float64[:,::1], boolean[::1])", **OPTIONS)
def mark_front(pose, rays, front):
    """Mark the points in front of both images; returns how many."""
    w, count = np.empty(3), 0
    for n in range(len(rays)):
        l1, l2 = 0.0, 0.0
        for i in range(3):
            w[i] = pose[i, 0] * rays[n, 3] + pose[i, 1] * rays[n, 4] + pose[i, 2] * rays[n, 5]
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            c = rays[n, j] * w[k] - rays[n, k] * w[j]
            l1 += (pose[j, 3] * w[k] - pose[k, 3] * w[j]) * c
            l2 += (pose[j, 3] * rays[n, k] - pose[k, 3] * rays[n, j]) * c
        front[n] = l1 > 0.0 and l2 > 0.0
        count += front[n]
    return count


@njit("void(float64[:,::1], float64[:,::1], float64[::1], float64[:,::1], boolean[::1])", **OPTIONS)
def decompose(E, rays, v, pose, front):
    """Fill in the (R, b) of E with most points that fit in front of both images, and mark those."""
    t, C, trial, there, most = np.empty(3), np.empty((3, 3)), np.empty((3, 4)), np.empty(len(rays), dtype=np.bool_), -1
    largest = -1.0
    for i in range(3):
        for j in range(3):
            a, b, c, d = (i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3
            C[i, j] = E[a, c] * E[b, d] - E[a, d] * E[b, c]
    for column in range(3):  # cof(E) = t t'R: every column is along t
        square = C[0, column] ** 2 + C[1, column] ** 2 + C[2, column] ** 2
        if square > largest:
            largest = square
            for i in range(3):
                t[i] = C[i, column] / np.sqrt(square)
    for twist in range(2):
        for side in range(2):
            for i in range(3):
                a, b = (i + 1) % 3, (i + 2) % 3
                for j in range(3):
                    across = t[a] * E[b, j] - t[b] * E[a, j]
                    trial[i, j] = C[i, j] - across if twist == 0 else C[i, j] + across
                trial[i, 3] = t[i] if side == 0 else -t[i]
            mark_front(trial, rays, there)
            count = 0
            for n in range(len(rays)):
                count += there[n] and abs(v[n]) < FITS
            if count > most:
                most = count
                assign(trial, pose)
                front[:] = there


@njit("void(float64[:,::1], float64[:,::1])", **OPTIONS)
def essential_of(pose, E):
    """Fill E = -[b]x R."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        for column in range(3):
            E[i, column] = pose[j, column] * pose[k, 3] - pose[k, column] * pose[j, 3]


@njit("float64(float64[::1], float64[::1])", **OPTIONS)
def spread(v, work):
    """Robust standard deviation of the distances, at least 1."""
    n = len(v)
    for k in range(n):
        work[k] = abs(v[k])
    return min(max(select(work, n, int(QUANTILE * n)) / AT_QUANTILE, 1.0), MOST_SPREAD)


@njit(
    "float64(float64[:,::1], float64[:,::1], float64[:,::1], float64[::1], boolean[::1], boolean[::1], float64[:,::1], float64[:,::1])",
    **OPTIONS,
)
def improve(E, rays, pose, v, front, active, work, W):
    """Decompose E, adjust with the points that fit, judge anew; E, pose and v are those of the result.

    Returns
    -------
    float
        Cauchy's cost, points behind an image as gross errors.
    """
    n, size = len(rays), np.empty(len(rays))
    judge(E, rays, np.inf, v)
    decompose(E, rays, v, pose, front)
    for _ in range(2):
        bound, count = FITS * spread(v, size), 0
        for k in range(n):
            active[k] = abs(v[k]) < bound and front[k]
            count += active[k]
        if count < 6:
            break
        adjust(pose, rays, active, ITERATIONS, work, W)
        essential_of(pose, E)
        judge(E, rays, np.inf, v)
        mark_front(pose, rays, front)
    cost = 0.0
    for k in range(n):
        cost += np.log(1.0 + (v[k] / CAUCHY) ** 2) if front[k] else np.log(1.0 + (BEHIND / CAUCHY) ** 2)
    return cost


@njit("boolean(float64[:,::1], float64[:,::1])", **OPTIONS)
def alike(one, other):
    """Whether two orientations are one."""
    trace, cosine = 0.0, 0.0
    for i in range(3):
        cosine += one[i, 3] * other[i, 3]
        for j in range(3):
            trace += one[i, j] * other[i, j]
    return 0.5 * (trace - 1.0) > np.cos(ALIKE) and cosine > np.cos(ALIKE)
