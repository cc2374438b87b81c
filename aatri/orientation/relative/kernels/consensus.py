"""Orientations of pairs without start values, compiled: five-point samples, judged by all points.

Samples are drawn by a generator of fixed seed, the same for every pair. The best hypothesis so far is decomposed,
adjusted with the points that fit and judged anew (`hypotheses`). Sampling ends when a sample without gross errors has
been drawn with probability 1 - `MISSED`, by the share of the points that fit. Of all that was found the best
orientations that differ are adjusted and returned: two of nearly the same cost mean that the points do not tell which
is right, as over a plane: the other orientation of points in a plane is always tried (`plane_twin`).

`pose` and `rays` are those of `sampson`. Source: Fischler & Bolles 1981; Chum, Matas & Kittler, DAGM 2003 (local
optimisation).
"""

import numpy as np
from numba import njit

from aatri.adjustment.kernels.small import OPTIONS
from aatri.orientation.relative.kernels.five_point import REAL_ROOTS, five_point
from aatri.orientation.relative.kernels.hypotheses import FITS, alike, essential_of, improve, judge, mark_front, spread
from aatri.orientation.relative.kernels.plane_twin import plane_of, twin
from aatri.orientation.relative.kernels.sampson import assign

LISTED = 4
"""Hypotheses kept for the end."""

NEAR = 0.15
"""Hypotheses that differ by less, in rad, are one in the list: noise of a sample, not another orientation."""

KEPT = 3
"""Orientations returned of a pair, at most."""

JUDGES = 100
"""Points of a pair that judge hypotheses, at most: evenly taken of all; all are asked in the end which of them fit."""

HOPELESS = 2.0
"""Hypotheses whose cost per point exceeds twice the best one's by more than this are not adjusted."""

FEWEST = 6
"""Samples drawn at least."""

MISSED = 1e-5
"""Probability that no sample was free of gross errors."""


@njit("void(float64[:,:,::1], float64[::1], float64[:,::1], float64)", **OPTIONS)
def enlist(listed, costs, E, cost):
    """Put a hypothesis into the list, in place of one that is nearly the same or of the worst one."""
    place = len(costs) - 1
    for k in range(len(costs)):
        if costs[k] < np.inf:
            dot = 0.0
            for e in range(9):
                dot += listed[k, e // 3, e % 3] * E[e // 3, e % 3]
            if abs(dot) > 2.0 * np.cos(NEAR):
                if costs[k] <= cost:
                    return
                place = k
                break
    if cost < costs[place]:
        costs[place] = cost
        assign(E, listed[place])
        while place > 0 and costs[place - 1] > costs[place]:
            costs[place - 1], costs[place] = costs[place], costs[place - 1]
            for e in range(9):
                i, j = e // 3, e % 3
                listed[place - 1, i, j], listed[place, i, j] = listed[place, i, j], listed[place - 1, i, j]
            place -= 1


@njit("void(float64[:,:,::1], float64[::1], float64[:,::1], float64)", **OPTIONS)
def keep(poses, costs, pose, cost):
    """Put an orientation among those kept, in place of one that is the same or of the worst one."""
    place = len(costs) - 1
    for k in range(len(costs)):
        if costs[k] < np.inf and alike(poses[k], pose):
            place = k
            break
    if not cost < costs[place]:
        return
    while place > 0 and costs[place - 1] > cost:
        costs[place] = costs[place - 1]
        assign(poses[place - 1], poses[place])
        place -= 1
    costs[place] = cost
    assign(pose, poses[place])


@njit("uint64(uint64)", **OPTIONS)
def following(seed):
    """The next of a sequence of pseudo-random numbers (xorshift)."""
    seed ^= seed << np.uint64(13)
    seed ^= seed >> np.uint64(7)
    return seed ^ (seed << np.uint64(17))


@njit(
    "void(int64, int64, int64[::1], boolean[::1], float64[:,::1], int64, float64[:,:,:,::1], float64[:,::1], int64[::1], boolean[::1])",
    **OPTIONS,
)
def consensus(first, last, start, chosen, all_rays, most_samples, poses, costs, samples, fits):
    """Orient the chosen pairs among first ... last - 1.

    Parameters
    ----------
    start : (n_pairs + 1,) int64
        First point of each pair; five or more.
    all_rays : (n, 10) float64
        See `sampson`.
    most_samples : int
    poses : (n_pairs, KEPT, 3, 4) float64
        Filled in, the best first.
    costs : (n_pairs, KEPT) float64
        Filled in; inf where there are no more.
    samples : (n_pairs,) int64
        Filled in: how many were drawn.
    fits : (n,) bool
        Filled in: points that fit the best orientation.
    """
    E, sample, listed, listed_cost = (
        np.empty((REAL_ROOTS, 3, 3)),
        np.empty(5, dtype=np.int64),
        np.empty((LISTED, 3, 3)),
        np.empty(LISTED),
    )
    pose, W, best, plane = np.empty((3, 4)), np.empty((5, 5)), np.empty((3, 3)), np.empty(3)
    for p in range(first, last):
        costs[p, :] = np.inf
        samples[p] = 0
        everything = start[p + 1] - start[p]
        if not chosen[p] or everything < 5:
            continue
        n = min(everything, JUDGES)
        rays = np.empty((n, 10))
        for k in range(n):
            rays[k] = all_rays[start[p] + k * everything // n]
        left, right, v, work = np.empty((n, 3)), np.empty((n, 3)), np.empty(n), np.empty((n, 9))
        front, active = np.empty(n, dtype=np.bool_), np.empty(n, dtype=np.bool_)
        for k in range(n):
            l1 = np.sqrt(rays[k, 0] ** 2 + rays[k, 1] ** 2 + rays[k, 2] ** 2)
            l2 = np.sqrt(rays[k, 3] ** 2 + rays[k, 4] ** 2 + rays[k, 5] ** 2)
            for i in range(3):
                left[k, i], right[k, i] = rays[k, i] / l1, rays[k, 3 + i] / l2
        seed, needed, listed_cost[:] = np.uint64(88172645463325252), most_samples, np.inf
        while samples[p] < needed:
            samples[p] += 1
            for k in range(5):
                fresh = False
                while not fresh:
                    seed, fresh = following(seed), True
                    sample[k] = np.int64(seed >> np.uint64(11)) % n
                    for j in range(k):
                        fresh = fresh and sample[j] != sample[k]
            many, before = five_point(left, right, sample, E), listed_cost[0]
            for h in range(many):
                cost = judge(E[h], rays, listed_cost[LISTED - 1], v)
                if cost < np.inf:
                    enlist(listed, listed_cost, E[h], cost)
            if listed_cost[0] < before:
                assign(listed[0], best)
                improve(best, rays, pose, v, front, active, work, W)
                cost, count, bound = judge(best, rays, np.inf, v), 0, FITS * spread(v, left[:, 0].copy())
                if cost < listed_cost[0]:
                    enlist(listed, listed_cost, best, cost)
                for k in range(n):
                    count += abs(v[k]) < bound and front[k]
                failing = 1.0 - min((count / n) ** 5, 1.0 - 1e-12)
                if failing < 1.0:
                    sample_count = max(np.log(MISSED) / np.log(failing), 1.0 * FEWEST)
                    needed = most_samples if sample_count > most_samples else int(sample_count) + 1
        for h in range(LISTED):
            if not listed_cost[h] < 2.0 * listed_cost[0] + HOPELESS * n:
                break
            assign(listed[h], best)
            cost = improve(best, rays, pose, v, front, active, work, W)
            keep(poses[p], costs[p], pose, cost)
        if costs[p, 0] < np.inf:
            essential_of(poses[p, 0], best)
            judge(best, rays, np.inf, v)
            mark_front(poses[p, 0], rays, front)
            bound = FITS * spread(v, left[:, 0].copy())
            for k in range(n):
                active[k] = abs(v[k]) < bound and front[k]
            if plane_of(poses[p, 0], rays, active, plane) and twin(poses[p, 0], plane, pose):
                essential_of(pose, best)
                cost = improve(best, rays, pose, v, front, active, work, W)
                keep(poses[p], costs[p], pose, cost)
        if costs[p, 0] < np.inf:
            rays, v, front = (
                all_rays[start[p] : start[p + 1]],
                np.empty(everything),
                np.empty(everything, dtype=np.bool_),
            )
            essential_of(poses[p, 0], best)
            judge(best, rays, np.inf, v)
            mark_front(poses[p, 0], rays, front)
            bound = FITS * spread(v, np.empty(everything))
            for k in range(everything):
                fits[start[p] + k] = abs(v[k]) < bound and front[k]
