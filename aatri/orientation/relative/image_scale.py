"""By how much the standard deviations of the image points are too small, before any point is rejected for good.

Guessed standard deviations that are half of what they should be make a tenth of all points gross errors. So the pairs
are oriented once with those given; the y-parallaxes of all their points together, the rejected ones among them, tell
the scale s of the image coordinates (adjustment.statistics.class_scales), which a few gross errors hardly touch. Where
it is clearly above 1 the pairs are oriented anew with s times the standard deviations, until s stands still. What was
rejected for them comes back, and the covariances of the models are those that the points deserve.

Standard deviations that are too large reject nothing that is right, and stay.

Where they are wrong by more than some ten times most pairs make no model: too few points fit one orientation, or no
base is seen. Then some of the pairs are oriented with multiples of them, and what makes most models is the start.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from aatri.adjustment.statistics.class_scales import class_scales
from aatri.adjustment.statistics.limits import COARSEST_RAD, limit_of_tests
from aatri.arrays import Bool, Int
from aatri.geometry.coplanarity import RayPairs
from aatri.orientation.relative.critical import angle_sigmas
from aatri.orientation.relative.limits import MULTIPLES, NEEDS_SMALLER, SAMPLED_PAIRS
from aatri.orientation.relative.orientations import RelativeOrientations, rows_of_pairs

ROUNDS = 5
SETTLED = 0.05
"""Change of the scale, as a share of it, at which the rounds end."""


def with_image_scale(
    orient: Callable[[RayPairs, Int], RelativeOrientations], rays: RayPairs, start: Int
) -> RelativeOrientations:
    """Orientations with the scale that the image points ask for.

    Parameters
    ----------
    orient : callable
        Orients pairs by their rays; the second are their rows in all pairs.
    start : (m + 1,) int
        First point of each pair.
    """
    every, scale = np.arange(len(start) - 1), 1.0
    orientations = as_stated = orient(rays, every)
    if 2 * orientations.formed.sum() < len(every):
        scale = _multiple_of_most(orient, rays, start, orientations.formed)
        orientations = as_stated if scale == 1.0 else orient(with_sigmas(rays, scale), every)
    least = min(scale, 1.0)
    for _ in range(ROUNDS):
        requested_scale, clear = _scale_of(orientations)
        better = max(scale * requested_scale, least)
        settled = abs(better - scale) <= SETTLED * scale
        if settled or (scale == 1.0 and not clear):
            break
        scale = better
        orientations = orient(with_sigmas(rays, scale), every)
    if least < 1.0 and scale > NEEDS_SMALLER:  # a base that smaller ones have made of the errors alone
        return as_stated
    return replace(orientations, sigma0=scale * orientations.sigma0, scale=scale)


def _multiple_of_most(
    orient: Callable[[RayPairs, Int], RelativeOrientations], rays: RayPairs, start: Int, formed: Bool
) -> float:
    """The multiple of the standard deviations that makes most models of pairs evenly taken; 1: those stated do."""
    count = min(len(formed), SAMPLED_PAIRS)
    pairs = np.arange(count) * len(formed) // count
    sample = rays.take(rows_of_pairs(start, pairs))
    if not len(sample.left):
        return 1.0
    stated_rad, best, most = float(np.median(angle_sigmas(sample))), 1.0, int(formed[pairs].sum())
    for multiple in MULTIPLES:
        if most < count and (multiple * stated_rad <= COARSEST_RAD or multiple < 1.0):
            models = int(orient(with_sigmas(sample, multiple), pairs).formed.sum())
            best, most = (multiple, models) if models > most else (best, most)
    return best


def with_sigmas(rays: RayPairs, scale: float) -> RayPairs:
    """The rays with `scale` times their standard deviations."""
    return replace(rays, left_sigma=scale * rays.left_sigma, right_sigma=scale * rays.right_sigma)


def limit_of(rays: RayPairs, limit: float | None) -> float:
    """The limit of a test that is given, or that counts the points tested."""
    return limit_of_tests(len(rays.left)) if limit is None else limit


def _scale_of(orientations: RelativeOrientations) -> tuple[float, bool]:
    """The scale of all y-parallaxes, of rejected points too, and whether it is clearly above 1."""
    with np.errstate(divide="ignore", invalid="ignore"):
        redundancy = np.minimum(np.abs(orientations.parallax_mm / orientations.error_mm), 1.0)
    tested = np.isfinite(redundancy) & np.isfinite(orientations.test)
    r = np.where(tested, redundancy, 0.0)
    scales = class_scales(np.where(tested, orientations.test, 0.0) * np.sqrt(r), r, np.where(tested, 0, -1), 1)
    return float(scales.scale[0]), bool(scales.differing[0] > 1.0)
