"""Adjustment of a relative orientation from a given start, with data snooping.

The observations are the Sampson distances of the points (`geometry.coplanarity.sampson`), the unknowns the rotation
increment and the turn of the base along its tangents. With many points the largest gross errors go several at a time
before the snooping, which tests them for re-admission. Points behind an image are taken out. Plain pairs go through
the compiled form of this, `relative.pairs`; this is for all others, and its reference.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from aatri.adjustment.dense import DenseResult, Linearise, adjust
from aatri.adjustment.statistics.snooping import snoop, statistics
from aatri.arrays import Bool, Float
from aatri.errors import ConvergenceError
from aatri.geometry.coplanarity import RayPairs, sampson
from aatri.geometry.intersection import Intersection, intersect_pair
from aatri.geometry.rotations import exp_rotation
from aatri.geometry.vectors import tangents, unit
from aatri.orientation.relative.kernels.snooping import MANY, ROUNDS

State = tuple[Float, Float, Float]
"""(left_from_right (3, 3), base (3,), tangents of the base (3, 2))."""

UNKNOWNS = ("rotation about x", "rotation about y", "rotation about z", "base along tangent 1", "base along tangent 2")

ENOUGH = 0.6
"""Share of the points that fit and lie in front of both images in a solution that needs no other start."""

BEHIND = 0.1
"""A larger share of points that fit, but behind an image, tells of the other orientation of points in a plane."""

FALLBACKS = 3
"""Adjustments in all, while points fall behind an image."""

SNOOPED = 7
"""With fewer points an error is seen, but not located."""


@dataclass(frozen=True)
class AdjustedPair:
    """A relative orientation adjusted from one start.

    Attributes
    ----------
    result : DenseResult
        Of the active points.
    active : (n,) bool
    test : (n,) float64
        Test statistic; NaN where uncontrolled.
    points : Intersection
    good : bool
        Enough points fit: another start cannot do much better.
    """

    result: DenseResult[State]
    active: Bool
    test: Float
    points: Intersection
    good: bool


def state_of(left_from_right: Float, base: Float) -> State:
    """The state of an orientation."""
    return left_from_right, base, tangents(base)


def adjust_pair(rays: RayPairs, start: State, active: Bool, *, limit: float, max_iterations: int) -> AdjustedPair:
    """Adjust with snooping; points that come to lie behind an image are taken out and it is adjusted again.

    Parameters
    ----------
    rays : RayPairs
    start : State
    active : (n,) bool
        Points to begin with; the others are tested for re-admission.
    limit : float
        Largest test statistic of an active point.
    max_iterations : int

    Raises
    ------
    GeometryError
        If the points do not determine the orientation.
    ConvergenceError
        If the start does not lead to an orientation with points in front.
    """
    n = len(active)
    behind = np.zeros(n, dtype=bool)
    for _ in range(FALLBACKS):
        inside = np.flatnonzero(~behind)
        result, kept = _snooped(rays.take(inside), start, active[inside], limit, max_iterations)
        active = np.zeros(n, dtype=bool)
        active[inside] = kept
        start = result.state
        points = intersect_pair(start[0], start[1], rays)
        newly = active & ~(points.depth > 0).all(axis=1)
        if not newly.any():
            break
        behind |= newly
        active &= ~newly
        if active.sum() < 5:
            raise ConvergenceError(f"only {int(active.sum())} of {n} points fit and lie in front of both images")
    else:
        raise ConvergenceError(f"points keep falling behind the images, {int(behind.sum())} of {n} so far")
    test = statistics(_linearise(rays), result, active)[1]
    fits = result.redundancy <= 1 or bool((np.nan_to_num(test[active]) <= limit).all())
    # Standard deviations that are too small leave misfits everywhere; another start would not mend that. But where most
    # points had to go, those left can fit an orientation that is wrong altogether.
    near = float(np.median(np.abs(sampson(*start, rays)[0]))) <= limit
    enough = bool(active.sum() >= ENOUGH * n and behind.sum() <= BEHIND * n)
    return AdjustedPair(result, active, test, points, (near or fits) and enough)


def _update(state: State, step: Float) -> State:
    R, b, T = state
    return state_of(exp_rotation(step[:3]) @ R, unit(b + T @ step[3:]))


def _linearise(rays: RayPairs) -> Linearise[State]:
    def linearise(state: State) -> tuple[Float, Float]:
        v, J = sampson(*state, rays)
        return v[:, None], J[:, None]

    return linearise


def _snooped(
    rays: RayPairs, start: State, active: Bool, limit: float, max_iterations: int
) -> tuple[DenseResult[State], Bool]:
    """Adjustment with data snooping; with fewer than seven points an error is seen, but not located."""
    n = len(active)
    linearise = _linearise(rays)

    def solve(use: Bool, state: State) -> DenseResult[State]:
        part = rays.take(use)
        return adjust(lambda s: sampson(*s, part), _update, state,
                      names=UNKNOWNS, max_iterations=max_iterations, what="relative orientation")  # fmt: skip

    if n < SNOOPED:
        everything = np.ones(n, dtype=bool)
        return solve(everything, start), everything
    active, start = _coarsely_cleaned(solve, linearise, start, active, limit)
    most_rejected = min(max(0.4 * n, 0.1 * n + n - active.sum()), n - 6.5)
    snooped = snoop(solve, linearise, start, n, limit=limit, max_share=most_rejected / n, active=active)
    return snooped.result, snooped.active


def _coarsely_cleaned(
    solve: Callable[[Bool, State], DenseResult[State]],
    linearise: Linearise[State],
    start: State,
    active: Bool,
    limit: float,
) -> tuple[Bool, State]:
    """With many points, those beyond half of the largest test statistic go together, until the rest is near."""
    for _ in range(ROUNDS):
        if active.sum() <= MANY:
            break
        result = solve(active, start)
        start = result.state
        test = statistics(linearise, result, active)[1]
        bound = max(2 * limit, 0.5 * float(np.nanmax(test[active])))
        keep = test <= bound
        if keep.sum() < MANY or (keep == active).all():
            break
        active = np.asarray(keep)
    return active, start
