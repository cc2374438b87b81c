"""Relative orientation of one pair in NumPy: the reference of the compiled loops (`relative.loops`).

The same rules, with the dense adjustment and data snooping of `tests.adjustment`: the parallel start, else the best of
the starts by five-point essential matrices.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from aatri.arrays import Bool, Float
from aatri.errors import ConvergenceError, GeometryError
from aatri.geometry.coplanarity import RayPairs, parallax, sampson
from aatri.geometry.intersection import Intersection, intersect_pair
from aatri.geometry.rotations import exp_rotation
from aatri.geometry.vectors import tangents, unit
from aatri.orientation.relative.critical import degenerate_pairs, judged
from aatri.orientation.relative.kernels.snooping import MANY, ROUNDS, SNOOPED
from aatri.orientation.relative.kernels.start import FITS
from aatri.orientation.relative.limits import BEHIND_SHARE, ENOUGH_FIT, LEAST_SHARE_OF_MODEL
from aatri.orientation.relative.loops import FALLBACKS
from tests.adjustment.dense import DenseResult, Linearise, adjust
from tests.adjustment.statistics.snooping import snoop, statistics
from tests.orientation.relative.five_point import essential_starts

State = tuple[Float, Float, Float]
"""(left_from_right (3, 3), base (3,), tangents of the base (3, 2))."""

UNKNOWNS = ("rotation about x", "rotation about y", "rotation about z", "base along tangent 1", "base along tangent 2")


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
    enough = bool(active.sum() >= ENOUGH_FIT * n and behind.sum() <= BEHIND_SHARE * n)
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


@dataclass(frozen=True)
class RelativeOrientation:
    """Fields as of `RelativeOrientations`; `behind`: points behind an image, never active."""

    left_from_right: Float
    base: Float
    covariance: Float
    sigma0: float
    redundancy: int
    iterations: int
    active: Bool
    parallax_mm: Float
    error_mm: Float
    error_sigma_mm: Float
    test: Float
    behind: Bool
    points: Intersection
    warnings: tuple[str, ...]


def relative_orientation(
    rays: RayPairs, *, snooping_limit: float = 4.0, max_iterations: int = 20, min_points: int = 5
) -> RelativeOrientation:
    """Orient the right image of a pair to the left one.

    Parameters
    ----------
    rays : RayPairs
        The points measured in both images.
    snooping_limit : float
        Points whose y-parallax is wrong by more than this many standard deviations are rejected, the worst first.
    max_iterations : int
    min_points : int
        Fewer points, or fewer left after snooping, make no model. At least 5.

    Raises
    ------
    GeometryError
        If the points do not determine an orientation or fit none; the message says why.
    """
    refused = degenerate_pairs(rays, np.array([0, len(rays.left)]), max(min_points, 5))
    if refused:
        raise GeometryError(refused[0])
    solution = _best(rays, snooping_limit, max_iterations)
    used, n = int(solution.active.sum()), len(solution.active)
    if used < max(min_points, 5) or used < LEAST_SHARE_OF_MODEL * n:
        raise GeometryError(f"only {used} of {n} points fit one orientation")
    return _finish(rays, solution, snooping_limit)


def _best(rays: RayPairs, limit: float, max_iterations: int) -> AdjustedPair:
    """The solution from the parallel start if it is good, else the best of all starts."""
    best: AdjustedPair | None = None
    failures: list[GeometryError | ConvergenceError] = []
    for start, inliers in _starts(rays, limit):
        try:
            solution = adjust_pair(rays, start, inliers, limit=limit, max_iterations=max_iterations)
        except (GeometryError, ConvergenceError) as error:
            failures.append(error)
            continue
        if best is None or _rank(solution) < _rank(best):
            best = solution
        if best.good:
            return best
    if best is None:
        open_geometry = [error for error in failures if isinstance(error, GeometryError)]
        if open_geometry:
            raise open_geometry[0]
        raise GeometryError(f"no relation between the images fits one orientation: {failures[-1].what}")
    return best


def _starts(rays: RayPairs, limit: float) -> Iterator[tuple[State, Bool]]:
    """Starts in the order of their cost: (state, points to begin with)."""
    everything = np.ones(len(rays.left), dtype=bool)
    yield state_of(*parallel_start(rays)), everything
    for R, b in essential_starts(rays):
        start = state_of(R, b)
        v = np.abs(sampson(*start, rays)[0])
        fitting = v < max(3 * limit, 5 * float(np.median(v)))
        yield start, fitting if fitting.sum() >= 6 else everything


def _rank(solution: AdjustedPair) -> tuple[int, float]:
    squares = float(solution.result.residual @ solution.result.residual)
    return -int(solution.active.sum()), squares


def _finish(rays: RayPairs, solution: AdjustedPair, limit: float) -> RelativeOrientation:
    result = solution.result
    R, b, T = result.state
    p, sigma = parallax(R, b, rays)
    v, J = sampson(R, b, T, rays)
    leverage = np.einsum("ni,ij,nj->n", J, result.covariance, J)
    r = np.where(solution.active, 1.0 - leverage, 1.0 + leverage)
    controlled = (r > 1e-6) & np.isfinite(solution.test)
    r = np.where(controlled, r, np.nan)
    error = np.where(solution.active, p / r, np.where(controlled, p, np.nan))
    error_sigma = np.where(solution.active, sigma / np.sqrt(r), sigma * np.sqrt(r))
    return RelativeOrientation(
        left_from_right=R, base=b, covariance=result.covariance, sigma0=result.sigma0, redundancy=result.redundancy,
        iterations=result.iterations, active=solution.active, parallax_mm=p, error_mm=error,
        error_sigma_mm=error_sigma, test=np.abs(v) / np.sqrt(r),
        behind=np.asarray(~(solution.points.depth > 0).all(axis=1)),
        points=solution.points,
        warnings=judged(result.covariance, result.redundancy, result.sigma0, solution.active, limit,
                        solution.points.xyz, b),
    )  # fmt: skip


def parallel_start(rays: RayPairs) -> tuple[Float, Float]:
    """Rotation and base of two images that look the same way.

    Returns
    -------
    left_from_right : (3, 3) float64
    base : (3,) float64, unit vector
    """
    q1, q2 = (u[:, :2] @ [1, 1j] / -u[:, 2] for u in (rays.left, rays.right))
    weight = np.ones(len(q1))
    for _ in range(FITS):
        total = weight.sum()
        m1, m2 = (weight * q1).sum() / total, (weight * q2).sum() / total
        d1, d2 = q1 - m1, q2 - m2
        a = (weight * d1 * d2.conj()).sum() / max((weight * np.abs(d2) ** 2).sum(), 1e-300)
        misfit = np.abs(d1 - a * d2)
        weight = 1.0 / np.maximum(misfit, 1e-3 * max(float(np.median(misfit)), 1e-9))
    turn = a / max(abs(a), 1e-300) if abs(a) > 0 else 1.0
    R = np.array([[turn.real, -turn.imag, 0.0], [turn.imag, turn.real, 0.0], [0.0, 0.0, 1.0]])
    t = m1 - turn * m2
    return R, unit([t.real, t.imag, 0.0]) if abs(t) > 1e-12 else np.array([1.0, 0.0, 0.0])
