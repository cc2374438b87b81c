"""Dependent relative orientation of many pairs.

A compiled loop over the pairs, in threads (`pair_loops`), takes those that are plain: their points clearly spread, and
the parallel start leads to a solution that needs no other start. Rejections, model points and statistics follow the
rules of `relative.dependent`, which takes all other pairs, one by one, and gives the reasons.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aatri.arrays import Int
from aatri.errors import GeometryError
from aatri.geometry.coplanarity import RayPairs
from aatri.geometry.intersection import Intersection
from aatri.orientation.relative.dependent import relative_orientation
from aatri.orientation.relative.image_scale import limit_of, with_image_scale
from aatri.orientation.relative.kernels.start import parallel_starts
from aatri.orientation.relative.pair_loops import Portion, RelativeOrientations, oriented_in_loops
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
    snooping_limit, max_iterations, min_points
        See `dependent.relative_orientation`; without a limit it counts the points tested.
    reporter : Reporter
        Told how many pairs are done.
    """
    limit = limit_of(rays, snooping_limit)
    found, scale = with_image_scale(
        lambda scaled: _oriented(scaled, start, limit, max_iterations, min_points, reporter), lambda made: made, rays
    )
    return replace(found, sigma0=scale * found.sigma0, scale=scale)


def _oriented(
    rays: RayPairs, start: Int, snooping_limit: float, max_iterations: int, min_points: int, reporter: Reporter
) -> RelativeOrientations:
    found = oriented_in_loops(rays, start, from_parallel, snooping_limit, max_iterations, min_points, reporter)
    left = [pair for pair in np.flatnonzero(~found.formed).tolist() if pair not in found.reasons]
    done = len(found.formed) - len(left)
    for k, pair in enumerate(left):
        reporter.progress(done + k, len(start) - 1, "models")
        one_by_one(found, rays, pair, start, snooping_limit, max_iterations, min_points)
    return found


def from_parallel(portion: Portion) -> None:
    """Start pairs as parallel images."""
    rays = portion.rays
    q = np.column_stack([rays.left[:, :2] / -rays.left[:, 2:], rays.right[:, :2] / -rays.right[:, 2:]])
    portion.all_pairs(parallel_starts, q, portion.chosen, portion.pose)


def one_by_one(
    found: RelativeOrientations,
    rays: RayPairs,
    pair: int,
    start: Int,
    limit: float,
    max_iterations: int,
    min_points: int,
) -> None:
    rows = slice(int(start[pair]), int(start[pair + 1]))
    try:
        one = relative_orientation(
            rays.take(np.arange(rows.start, rows.stop)),
            snooping_limit=limit,
            max_iterations=max_iterations,
            min_points=min_points,
        )
    except GeometryError as error:
        found.reasons[pair] = error.what
        return
    found.formed[pair] = True
    found.warnings[pair] = one.warnings
    for name in ("left_from_right", "base", "covariance", "sigma0", "redundancy", "iterations"):
        getattr(found, name)[pair] = getattr(one, name)
    for name in ("active", "parallax_mm", "error_mm", "error_sigma_mm", "test"):
        getattr(found, name)[rows] = getattr(one, name)
    points: Intersection = one.points
    found.xyz[rows], found.point_covariance[rows], found.depth[rows] = points.xyz, points.covariance, points.depth
