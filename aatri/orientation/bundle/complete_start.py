"""Start values a bundle adjustment still lacks: points by intersection, images by resection.

Points without coordinates are intersected from the oriented images; images without orientation get one from the known
points they see, by what is offered (a position, an orientation) or a closed three-point start, and a resection, if the
points agree with it more than by chance (`resection.start`). Both are repeated while they find anything new. Images
that see too few known points start from an orientation that is offered, if their rays meet those of other images there.
"""

import numpy as np

from aatri.adjustment.threads import in_threads
from aatri.arrays import Float, Int, finite_rows, ranges
from aatri.geometry.collinearity import in_image_axes, project
from aatri.geometry.intersection import intersect_rays
from aatri.geometry.known_rotations import DirectedRays, ObservedPlaces, places_by_rays
from aatri.geometry.limits import MIN_POINTS
from aatri.geometry.vectors import unit
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.poses import Poses
from aatri.orientation.resection.adjustment import resect_images
from aatri.orientation.resection.limits import FEWEST_LINEAR, LEAST_FITTING, WIDE_RAD
from aatri.orientation.resection.start import linear_orientation, start_orientation

MOST_PARTNERS = 8
"""Rays of a point with which each of them is tried."""

TURN_RAD = 1e-3
"""Standard deviation of a rotation that is offered, about: what counts is which places it lets rays determine."""

AT_ONCE = 200_000
"""Residuals that are held at a time, some 40 MB."""


def complete_start(
    rays: ImagePointRows, poses: Poses, xyz_m: Float, *, linear: bool = False, offered: Poses | None = None
) -> tuple[Poses, Float]:
    """Fill in what is missing and can be computed; what is known is left alone.

    Parameters
    ----------
    poses : Poses
        NaN where unknown.
    xyz_m : (n_points, 3) float64, m
        NaN where unknown.
    linear : bool
        The direct linear transformation first, for images that see six points not in a plane.
    offered : Poses, optional
        What else is known of images, observed or roughly; NaN where nothing is. Default: `poses`.
    """
    while True:
        xyz_m = intersected(rays, poses, xyz_m)
        completed = _resected(rays, poses, xyz_m, linear, offered or poses)
        if (completed.oriented == poses.oriented).all() and offered is not None:
            completed = _as_offered(rays, poses, offered)
        if (completed.oriented == poses.oriented).all() and offered is not None:
            completed = _as_offered(rays, poses, _turned_as_offered(rays, poses, xyz_m, offered))
        if (completed.oriented == poses.oriented).all():
            return completed, xyz_m
        poses = completed


def _as_offered(rays: ImagePointRows, poses: Poses, offered: Poses) -> Poses:
    """With images as they are offered, if most of their rays meet one of another image at least."""
    candidates, n = ~poses.oriented & offered.oriented, len(poses.position_m)
    if not candidates.any():
        return poses
    candidate_poses = offered.where(candidates, poses)
    both = _pairs(rays, np.flatnonzero(rays.active & candidate_poses.oriented[rays.image]))
    both = both[candidates[rays.image[both]].any(axis=1)]
    met = _meeting(rays, candidate_poses, both).repeat(2, axis=0)
    both = both.ravel()
    fits = (
        (_off_mm(rays, candidate_poses, both, met) <= WIDE_RAD * rays.c_mm[both]).reshape(-1, 2).all(axis=1).repeat(2)
    )
    total, count = (np.bincount(rays.image[np.unique(rows)], minlength=n) for rows in (both, both[fits]))
    return offered.where(candidates & (count >= MIN_POINTS) & (count >= (1.0 - LEAST_FITTING) * total), poses)


def _turned_as_offered(rays: ImagePointRows, poses: Poses, xyz_m: Float, offered: Poses) -> Poses:
    """Images of which a rotation is offered, where their rays and what is known place them."""
    n, turned = len(poses.position_m), ~poses.oriented & finite_rows(offered.ground_from_image)
    if not turned.any():
        return poses
    rotated = poses.where(poses.oriented, offered)
    shown = np.isin(rays.point, rays.point[rays.active & turned[rays.image]])
    rows = np.flatnonzero(rays.active & shown & finite_rows(rotated.ground_from_image)[rays.image])
    places = np.concatenate([poses.position_m, xyz_m])
    there = np.flatnonzero(finite_rows(places))
    directed = DirectedRays(
        rays.image[rows].astype(np.int64),
        n + rays.point[rows].astype(np.int64),
        unit(rays.directions(rotated, rows)),
        np.full(len(rows), TURN_RAD),
    )
    exact = ObservedPlaces(there, places[there], np.zeros((len(there), 3)))
    return Poses(places_by_rays(directed, exact, len(places))[0][:n], rotated.ground_from_image)


def _pairs(rays: ImagePointRows, use: Int) -> Int:
    """Rays of the same point, each with `MOST_PARTNERS` others, (k, 2)."""
    use = use[np.argsort(rays.point[use], kind="stable")]
    pairs = [np.zeros((0, 2), dtype=np.int64)]
    for step in range(1, MOST_PARTNERS + 1):
        rows = np.flatnonzero(rays.point[use[step:]] == rays.point[use[:-step]])
        pairs.append(np.column_stack([use[rows], use[rows + step]]))
    return np.concatenate(pairs)


def _meeting(rays: ImagePointRows, poses: Poses, pairs: Int) -> Float:
    """Where the rays of each pair meet, (k, 3), m."""
    both, image = pairs.ravel(), rays.image[pairs.ravel()]
    return intersect_rays(
        poses.position_m[image], rays.directions(poses, both), np.repeat(np.arange(len(pairs)), 2), len(pairs)
    )


def _off_mm(rays: ImagePointRows, poses: Poses, rows: Int, xyz_m: Float) -> Float:
    """How far from rays places are in the image, (n,); infinite behind it."""
    image = rays.image[rows]
    u = in_image_axes(poses.position_m[image], poses.ground_from_image[image], xyz_m)
    ahead = u[:, 2] < 0
    off_mm = np.linalg.norm(project(np.where(ahead[:, None], u, -1.0), rays.c_mm[rows]) - rays.xy_mm[rows], axis=1)
    return np.where(ahead, off_mm, np.inf)


def robust_intersections(rays: ImagePointRows, poses: Poses, points: Int, n_points: int) -> Float:
    """Points where two of their rays meet that more than half of all agree with best, (n_points, 3), m; others NaN.

    Source: Rousseeuw 1984, Least median of squares regression.
    """
    rows = np.flatnonzero(rays.active & np.isin(rays.point, points) & poses.oriented[rays.image])
    rows = rows[np.argsort(rays.point[rows], kind="stable")]
    first = np.flatnonzero(np.diff(rays.point[rows], prepend=-1))
    count = np.diff(first, append=len(rows))
    residuals = np.cumsum(count * np.minimum(MOST_PARTNERS * count, count * (count - 1) // 2))
    piece = residuals // AT_ONCE
    edges = [*first[np.flatnonzero(np.diff(piece, prepend=-1))].tolist(), len(rows)]
    xyz_m = np.full((n_points, 3), np.nan)

    def some_pieces(begin: int, end: int) -> None:
        for k in range(begin, end):
            of_pieces, met = _least_median(rays, poses, rows[edges[k] : edges[k + 1]])
            xyz_m[of_pieces] = met

    in_threads(len(edges) - 1, some_pieces, worth=1)
    return xyz_m


def _least_median(rays: ImagePointRows, poses: Poses, rows: Int) -> tuple[Int, Float]:
    """Points, (k,), and where their pair of least median residual meets, (k, 3), m; `rows` are all rays of some points.

    A point may stand there twice; the last counts.
    """
    pairs = _pairs(rays, rows)
    met, pair_point = _meeting(rays, poses, pairs), rays.point[pairs[:, 0]]
    begin, end = (np.searchsorted(rays.point[rows], pair_point, side) for side in ("left", "right"))
    count = end - begin
    pair = np.repeat(np.arange(len(pairs)), count)
    row = rows[ranges(begin, count)]
    off = _off_mm(rays, poses, row, met[pair])
    order = np.lexsort((off, pair))
    median = off[order[np.cumsum(count) - count + count // 2]] if len(pairs) else np.zeros(0)
    best_last = np.lexsort((-median, pair_point))
    return pair_point[best_last], np.where(np.isfinite(median[best_last])[:, None], met[best_last], np.nan)


def intersected(rays: ImagePointRows, poses: Poses, xyz_m: Float) -> Float:
    """Points, those without coordinates where the rays of oriented images meet, (n_points, 3), m."""
    missing = ~finite_rows(xyz_m)
    use = rays.active & missing[rays.point] & poses.oriented[rays.image]
    intersections = intersect_rays(
        poses.position_m[rays.image[use]], rays.directions(poses, use), rays.point[use], len(xyz_m)
    )
    return np.asarray(np.where(missing[:, None], intersections, xyz_m))


def _resected(rays: ImagePointRows, poses: Poses, xyz_m: Float, linear: bool, offered: Poses) -> Poses:
    position, rotation = poses.position_m.copy(), poses.ground_from_image.copy()
    missing = ~poses.oriented
    rows = np.flatnonzero(rays.active & finite_rows(xyz_m)[rays.point] & missing[rays.image])
    rows = rows[np.argsort(rays.image[rows], kind="stable")]
    images, first = np.unique(rays.image[rows], return_index=True)
    start_position, start_rotation = np.full_like(position, np.nan), np.full_like(rotation, np.nan)
    for image, image_rows in zip(images, np.split(rows, first[1:])):
        of_this_c = rays.xy_mm[rays.c_mm == rays.c_mm[image_rows][0]]  # in all images: one may have few
        image_data = rays.xy_mm[image_rows], float(rays.c_mm[image_rows][0]), xyz_m[rays.point[image_rows]]
        linear_start = linear_orientation(*image_data) if linear else None
        start = start_orientation(
            *image_data,
            area_mm2=float(np.prod(np.ptp(of_this_c, axis=0))),
            other_starts=() if linear_start is None else ((FEWEST_LINEAR, linear_start),),
            offered=(offered.position_m[image], offered.ground_from_image[image]),
        )
        if start is not None:
            start_position[image], start_rotation[image] = start
    c_mm = np.ones(len(position))
    c_mm[images] = rays.c_mm[rows[first]]
    result = resect_images(
        rays.xy_mm[rows],
        rays.sigma_mm[rows],
        rays.image[rows],
        rays.point[rows],
        c_mm,
        xyz_m,
        start_position,
        start_rotation,
    )
    converged = result.resected & finite_rows(start_position)
    position[converged], rotation[converged] = result.position_m[converged], result.ground_from_image[converged]
    return Poses(position, rotation)
