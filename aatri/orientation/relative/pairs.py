"""Dependent relative orientation of many pairs: the left image is fixed, the right one is oriented to it.

Unknowns are the rotation R of the right image (increment d, R <- exp([d]x) R) and the direction of the base b (turn t
along its two tangents T, b <- unit(b + T t)); the length of the base is 1. Every point gives one condition: its
Sampson distance v = -F / s_F, the coplanarity F = b . (u1 x R u2) over its standard deviation propagated from the
image coordinates (`geometry.coplanarity`). sum v^2 is minimised with exact derivatives; sigma0 a priori is 1. To first
order this is the bundle of the two images.

Nothing is assumed about the angles. The start is that of parallel images (`kernels.start`); where that does not lead to
a solution with few rejections and all points in front, five-point essential matrices give the start
(`kernels.consensus`).

Only the y-parallax is seen: an error of x in an image point, along the epipolar line, moves the model point and
nothing else; and whether the left or the right image point is wrong cannot be told.

Source: docs/formulas.md 3.2; Mikhail, Bethel & McGlone, Introduction to Modern Photogrammetry, 5.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from aatri.arrays import Bool, Int
from aatri.geometry.coplanarity import RayPairs, parallax
from aatri.geometry.intersection import intersect_pair
from aatri.orientation.relative.image_scale import limit_of, with_image_scale
from aatri.orientation.relative.limits import ENOUGH_FIT, LEAST_SHARE_OF_MODEL
from aatri.orientation.relative.loops import Portion, from_parallel, oriented_from
from aatri.orientation.relative.orientations import ImagePairs, PairSettings, RelativeOrientations
from aatri.progress import SILENT, Reporter


def relative_orientations(
    rays: RayPairs,
    start: Int,
    *,
    snooping_limit: float | None = None,
    max_iterations: int = 20,
    min_points: int = 5,
    reporter: Reporter = SILENT,
) -> RelativeOrientations:
    """Orient the right image of every pair to its left one.

    Parameters
    ----------
    rays : RayPairs
        The points of all pairs, pair by pair.
    start : (m + 1,) int
        First point of each pair; the last is the number of points.
    snooping_limit : float, optional
        Points whose y-parallax is wrong by more than this many standard deviations are rejected, the worst first;
        default: by the number of points.
    min_points : int
        Fewer points, or fewer left after snooping, make no model. At least 5.
    reporter : Reporter
        Told how many pairs are done.
    """
    settings, count = PairSettings(limit_of(rays, snooping_limit), max_iterations, min_points), np.diff(start)

    def orient(scaled: RayPairs, pairs: Int) -> RelativeOrientations:
        first = np.concatenate([[0], np.cumsum(count[pairs])])

        def by_consensus(portion: Portion) -> None:
            reporter.progress(0, 0, "pairs that are not nearly parallel, by five-point samples")
            from aatri.orientation.relative.from_consensus import FromConsensus

            FromConsensus(first)(portion)

        starts = ((from_parallel, ENOUGH_FIT), (by_consensus, LEAST_SHARE_OF_MODEL))
        return oriented_from(scaled, first, starts, settings, reporter)

    return with_image_scale(orient, rays, start)


def oriented_by(
    pairs: ImagePairs, orients: Bool, limit: float, orient: Callable[[RayPairs, Int], RelativeOrientations]
) -> RelativeOrientations:
    """Orientations by some of the points; the others are intersected, and judged by what they had no part in.

    Parameters
    ----------
    orients : (n,) bool
        Points that orient.
    limit : float
        Another point is rejected if its y-parallax is larger, in standard deviations of its image coordinates.
    orient : callable
        Orients pairs of rays and first rows.
    """
    every, use = np.arange(len(pairs.left)), np.flatnonzero(orients)
    part = orient(pairs.rays.take(use), np.concatenate([[0], np.cumsum(orients)])[pairs.start])
    orientations = RelativeOrientations.empty(len(every), len(orients))
    orientations.put(every, use, part, every, np.arange(len(use)))
    orientations = replace(orientations, reasons=part.reasons, warnings=part.warnings, scale=part.scale)
    for pair in np.flatnonzero(part.formed).tolist():
        rows = pairs.rows(pair)
        rows = rows[~orients[rows]]
        R, base, rays = part.left_from_right[pair], part.base[pair], pairs.rays.take(rows)
        points = intersect_pair(R, base, rays)
        orientations.xyz[rows], orientations.depth[rows] = points.xyz, points.depth
        orientations.point_covariance[rows] = points.covariance
        orientations.parallax_mm[rows], sigma = parallax(R, base, rays)
        orientations.error_mm[rows], orientations.error_sigma_mm[rows] = orientations.parallax_mm[rows], sigma
        orientations.test[rows] = np.abs(orientations.parallax_mm[rows]) / sigma
        orientations.active[rows] = (orientations.test[rows] <= limit) & (points.depth > 0).all(axis=1)
    return orientations
