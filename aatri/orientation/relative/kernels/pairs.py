"""Dependent relative orientation pair by pair, compiled; the method is that of `relative.dependent`.

A pair goes from the parallel start through snooping to its model points. Whatever is not plain (another start, an
error) leaves the pair with 0 iterations, for the NumPy form.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from aatri.adjustment.kernels.small import OPTIONS, inverse, median
from aatri.orientation.relative.kernels.model_points import intersect
from aatri.orientation.relative.kernels.sampson import linearise
from aatri.adjustment.kernels.snooping import count
from aatri.orientation.relative.kernels.snooping import snoop, statistics

FITS = 6
"""Reweighted fits of the parallel start."""

FALLBACKS = 3
"""Adjustments in all, while points fall behind an image."""

ENOUGH = 0.6
"""Share of the points that fit and lie in front of both images in a solution that needs no other start."""

FEWEST = 0.3
"""A smaller share of points that fit makes no model."""

SNOOPED = 7
"""With fewer points an error is seen, but not located."""


@njit("void(float64[:,::1], float64[:,::1], float64[:,::1], float64[::1])", **OPTIONS)
def parallel_start(rays, pose, work, size):
    """Fill R and b of two images that look the same way: q1 = a q2 + t for q = (x + iy) / c, weights 1 / |residual|."""
    n, a, m1, m2 = len(rays), 0j, 0j, 0j
    for k in range(n):
        work[k, 6] = 1.0
    for _ in range(FITS):
        m1, m2, total, dot, square = 0j, 0j, 0.0, 0j, 0.0
        for k in range(n):
            total += work[k, 6]
            m1 += work[k, 6] * complex(rays[k, 0], rays[k, 1]) / -rays[k, 2]
            m2 += work[k, 6] * complex(rays[k, 3], rays[k, 4]) / -rays[k, 5]
        m1, m2 = m1 / total, m2 / total
        for k in range(n):
            d1 = complex(rays[k, 0], rays[k, 1]) / -rays[k, 2] - m1
            d2 = complex(rays[k, 3], rays[k, 4]) / -rays[k, 5] - m2
            dot += work[k, 6] * d1 * d2.conjugate()
            square += work[k, 6] * (d2.real * d2.real + d2.imag * d2.imag)
        a = dot / max(square, 1e-300)
        for k in range(n):
            d1 = complex(rays[k, 0], rays[k, 1]) / -rays[k, 2] - m1
            d2 = complex(rays[k, 3], rays[k, 4]) / -rays[k, 5] - m2
            size[k] = abs(d1 - a * d2)
            work[k, 6] = size[k]
        floor = 1e-3 * max(median(size, n), 1e-9)
        for k in range(n):
            work[k, 6] = 1.0 / max(work[k, 6], floor)
    a = a / max(abs(a), 1e-300) if abs(a) > 0.0 else 1.0 + 0j
    t = m1 - a * m2
    t = t / abs(t) if abs(t) > 1e-12 else 1.0 + 0j
    for i in range(3):
        for j in range(4):
            pose[i, j] = 0.0
    pose[0, 0], pose[0, 1], pose[1, 0], pose[1, 1], pose[2, 2] = a.real, -a.imag, a.imag, a.real, 1.0
    pose[0, 3], pose[1, 3] = t.real, t.imag


@njit("int64(float64[:,::1], float64[:,::1], boolean[::1], float64, int64, float64[:,::1], float64[:,::1], float64[:,::1])", **OPTIONS)  # fmt: skip
def adjust_in_front(pose, rays, active, limit, max_iterations, work, W, model):
    """Adjust with snooping; points behind an image are taken out and it is adjusted again. Iterations, or 0."""
    n = len(rays)
    inside, left = np.empty(n, dtype=np.bool_), n
    for k in range(n):
        inside[k] = active[k] = True
    for _ in range(FALLBACKS):
        if left < SNOOPED:
            return 0
        iterations, before = snoop(pose, rays, inside, active, limit, max_iterations, work, W), left
        if iterations == 0:
            return 0
        intersect(pose, rays, model)
        for k in range(n):
            if active[k] and not (model[k, 12] > 0.0 and model[k, 13] > 0.0):
                inside[k] = active[k] = False
                left -= 1
        if left == before:
            return iterations
        if count(active) < 5:
            return 0
    return 0


@njit("float64(float64[:,::1], boolean[::1], float64, int64, float64[::1])", **OPTIONS)
def sum_of_squares(work, active, limit, min_points, size):
    """v'v of the active points; NaN unless enough of them fit: then another start is tried, or no model is formed."""
    n, used, fits, square = len(work), 0, True, 0.0
    for k in range(n):
        size[k] = abs(work[k, 0])
        if not size[k] < np.inf:
            return np.nan
        if active[k]:
            used += 1
            square += size[k] * size[k]
            fits = fits and not work[k, 6] > limit
    near = median(size, n) <= limit or ((fits or used <= 6) and used >= ENOUGH * n)
    return square if near and used >= max(min_points, 5) and used >= FEWEST * n else np.nan


@njit("void(int64, int64, int64[::1], float64[:,::1], boolean[::1], float64, int64, int64, float64[:,:,::1], float64[:,:,::1], int64[::1], float64[::1], boolean[::1], float64[:,::1], float64[:,::1])", **OPTIONS)  # fmt: skip
def orient(first, last, start, rays, plain, limit, max_iterations, min_points, pose, Q, iterations, square, active, work, model):  # fmt: skip
    """Orient the pairs first ... last - 1.

    Parameters
    ----------
    start : (n_pairs + 1,) int64
        First point of each pair.
    rays : (n, 10) float64
        See `sampson`.
    plain : (n_pairs,) bool
        Points clearly spread; the other pairs are left alone.
    limit, max_iterations, min_points
        Of the method.
    pose, Q : (n_pairs, 3, 4), (n_pairs, 5, 5) float64
        Orientation and its covariance.
    iterations : (n_pairs,) int64
        0 where the pair is left; what is filled in is then not to be used.
    square : (n_pairs,) float64
        v'v of the active points.
    active : (n,) bool
    work : (n, 9) float64
        See `sampson`, at the solution; the redundancy number of a rejected point is 1 + j'Qj.
    model : (n, 15) float64
        See `model_points.intersect`.
    """
    most = 0
    for p in range(first, last):
        most = max(most, start[p + 1] - start[p])
    size, W, N, g, T = np.empty(most), np.empty((5, 5)), np.empty((5, 5)), np.empty(5), np.empty((3, 3))
    for p in range(first, last):
        i, j = start[p], start[p + 1]
        if not plain[p]:
            continue
        of_pair, used, here = rays[i:j], active[i:j], work[i:j]
        parallel_start(of_pair, pose[p], here, size)
        done = adjust_in_front(pose[p], of_pair, used, limit, max_iterations, here, W, model[i:j])
        if done > 0:
            linearise(pose[p], of_pair, used, here, T, N, g)
            statistics(here, W, used)
            square[p] = sum_of_squares(here, used, limit, min_points, size)
            inverse(W, Q[p])
            iterations[p] = done if square[p] < np.inf else 0
