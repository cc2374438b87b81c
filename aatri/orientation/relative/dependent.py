"""Dependent relative orientation: the left image is fixed, the right one is oriented to it.

Unknowns are the rotation R of the right image (increment d, R <- exp([d]x) R) and the direction of the base b (turn t
along its two tangents T, b <- unit(b + T t)); the length of the base is 1. Every point gives one condition: its
Sampson distance v = -F / s_F, the coplanarity F = b . (u1 x R u2) over its standard deviation propagated from the
image coordinates (`geometry.coplanarity`). sum v^2 is minimised with exact derivatives; sigma0 a priori is 1. To first
order this is the bundle of the two images. This is the way of a single pair; `relative.pairs` sends many through a
compiled loop and comes back to it for those that are not plain.

Nothing is assumed about the angles. The start is that of parallel images (`relative_start`); where that does not
lead to a solution with few rejections and all points in front, the essential matrix gives the start.

Only the y-parallax is seen: an error of x in an image point, along the epipolar line, moves the model point and
nothing else; and whether the left or the right image point is wrong cannot be told.

Source: docs/formulas.md 3.2; Mikhail, Bethel & McGlone, Introduction to Modern Photogrammetry, 5.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from aatri.arrays import Bool, Float
from aatri.errors import ConvergenceError, GeometryError
from aatri.geometry.coplanarity import RayPairs, parallax, sampson
from aatri.geometry.intersection import Intersection
from aatri.geometry.rotations import angles_from_rotation
from aatri.orientation.relative.critical import critical_configuration
from aatri.orientation.relative.essential import essential_starts
from aatri.orientation.relative.pair_adjustment import AdjustedPair, State, adjust_pair, state_of
from aatri.orientation.relative.start import parallel_start, refuse_degenerate

WEAK_RAD = 0.01
"""A direction or rotation less certain than this is reported: the geometry is near a singular one."""

MANY_REJECTED = 0.2
"""A larger share of rejected points is reported."""

FEWEST = 0.3
"""A smaller share of points that fit makes no model."""

OPEN_RAD = 0.3
"""A direction or rotation less certain than this is not determined."""

_REMEDY = "check that the images belong together and the points carry the right ids"


@dataclass(frozen=True)
class RelativeOrientation:
    """Orientation of the right image to the left one, and the model.

    Attributes
    ----------
    left_from_right : (3, 3) float64
    base : (3,) float64, unit vector
    covariance : (5, 5) float64, rad^2
        Of d and t, a priori (sigma0 = 1).
    sigma0 : float
        NaN without redundancy.
    redundancy, iterations : int
    active : (n,) bool
        Points used in the orientation.
    parallax_mm : (n,) float64, mm
        y-parallax of every point.
    error_mm, error_sigma_mm : (n,) float64, mm
        Estimated gross error of the y-parallax and its standard deviation; NaN where uncontrolled.
    test : (n,) float64
        |error| / sigma; NaN where uncontrolled.
    behind : (n,) bool
        Points behind one of the images, or without intersection; never active.
    points : Intersection
        Model points.
    warnings : tuple of str
    """

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
    refuse_degenerate(rays, max(min_points, 5))
    solution = _best(rays, snooping_limit, max_iterations)
    used, n = int(solution.active.sum()), len(solution.active)
    if used < max(min_points, 5) or used < FEWEST * n:
        raise GeometryError(f"only {used} of {n} points fit one orientation", remedy=_REMEDY)
    return _finish(rays, solution, snooping_limit)


def dependent_angles(left_from_right: Float, base: Float) -> Float:
    """phi, omega, kappa of the right image in the Chinese system, mu = by/bx and nu = bz/bx.

    Parameters
    ----------
    left_from_right : (3, 3) float64
    base : (3,) float64

    Returns
    -------
    (5,) float64, rad and 1
    """
    angles = angles_from_rotation(left_from_right, "phi-omega-kappa")
    return np.concatenate([angles, base[1:] / base[0]])


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
        raise GeometryError(f"no relation between the images fits one orientation: {failures[-1].what}", remedy=_REMEDY)
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


def judged(
    covariance: Float, redundancy: int, sigma0: float, active: Bool, limit: float, xyz: Float, base: Float
) -> tuple[str, ...]:
    """What is to be said of an orientation; where it is weak or open, why, from its model points and base.

    Raises
    ------
    GeometryError
        If it is open.
    """
    found = []
    largest = float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
    if largest > OPEN_RAD:
        raise GeometryError(
            f"the orientation is open by {largest:.2g} rad: {critical_configuration(xyz[active], base)}",
            remedy="measure points over the whole overlap, at different heights",
        )
    if largest > WEAK_RAD:
        why = critical_configuration(xyz[active], base)
        found.append(f"weak geometry: the orientation is uncertain by {largest:.2g} rad; {why}")
    if redundancy == 0:
        found.append("exactly 5 points: no redundancy, nothing is checked")
    elif redundancy == 1 and sigma0 > limit:
        found.append(f"sigma0 is {sigma0:.1f} with one redundant point: there is a gross error, but which point "
                     "has it cannot be told")  # fmt: skip
    rejected, n = int((~active).sum()), len(active)
    if n >= 10 and rejected > MANY_REJECTED * n:
        found.append(f"{rejected} of {n} points are rejected: mismatches, or standard deviations that are too small")
    return tuple(found)
