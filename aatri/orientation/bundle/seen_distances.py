"""How far from the images the points lie that they see: of the whole block, and of each image."""

import numpy as np

from aatri.arrays import Bool, Float, finite_rows
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.poses import Poses

MOST_RAYS_LOOKED_AT = 20_000
"""Of so many rays, evenly taken, the median distance is that of all."""

RAYS_OF_AN_IMAGE = 30
"""Of so many rays, evenly taken, the median depth is good enough to turn an image about."""


def median_distance_m(rays: ImagePointRows | None, poses: Poses, xyz_m: Float) -> float | None:
    """Median distance of the points from the images that see them, m; None where nothing tells it."""
    if rays is None:
        return None
    evenly = slice(None, None, max(1, len(rays.image) // MOST_RAYS_LOOKED_AT))
    away = xyz_m[rays.point[evenly]] - poses.position_m[rays.image[evenly]]
    away = away[np.isfinite(away).all(axis=1) & rays.active[evenly]]
    return float(np.median(np.linalg.norm(away, axis=1))) if len(away) else None


def on_ground_m(rays: ImagePointRows | None, poses: Poses, xyz_m: Float) -> float:
    """Standard deviation of an image point on the ground, across its ray, median, m; NaN where nothing tells it."""
    distance_m = median_distance_m(rays, poses, xyz_m)
    if rays is None or distance_m is None:
        return float("nan")
    return float(np.nanmedian(rays.sigma_mm / rays.c_mm[:, None])) * distance_m


def seen_distances_m(rays: ImagePointRows | None, poses: Poses, xyz_m: Float) -> Float:
    """Median depth of the points that each image sees, (n_images,), m; 0 where none lies before it."""
    n = len(poses.position_m)
    if rays is None or not len(rays.image):
        return np.zeros(n)
    evenly = slice(None, None, max(1, len(rays.image) // (RAYS_OF_AN_IMAGE * n)))
    image, point = rays.image[evenly], rays.point[evenly]
    away = xyz_m[point] - poses.position_m[image]
    depth = -np.einsum("ni,ni->n", poses.ground_from_image[image, :, 2], away)
    usable = np.isfinite(depth) & rays.active[evenly]
    image, depth = image[usable], depth[usable]
    count = np.bincount(image, minlength=n)
    middle = np.minimum(np.cumsum(count) - count + count // 2, max(len(depth) - 1, 0))
    ordered = depth[np.lexsort((depth, image))]
    return np.where(count > 0, np.maximum(ordered[middle] if len(ordered) else 0.0, 0.0), 0.0)


def on_their_rays(rays: ImagePointRows, poses: Poses, xyz_m: Float, points: Bool) -> Float:
    """Points on the ray of an oriented image, as deep as the known point nearest in the image, (n_points, 3), m.

    Parameters
    ----------
    xyz_m : (n_points, 3) float64, m
    points : (n_points,) bool
        Which points are moved there; without such a ray they stay.
    """
    visible = rays.active & poses.oriented[rays.image]
    rows, known_rows = (
        np.flatnonzero(visible & points[rays.point]),
        visible & finite_rows(xyz_m)[rays.point] & ~points[rays.point],
    )
    rows, placed = rows[np.unique(rays.point[rows], return_index=True)[1]], xyz_m.copy()
    for image in np.unique(rays.image[rows]):
        image_rows, near = rows[rays.image[rows] == image], np.flatnonzero(known_rows & (rays.image == image))
        if len(near):
            away = np.linalg.norm(rays.xy_mm[image_rows][:, None] - rays.xy_mm[near], axis=2)
            X0, axis = poses.position_m[image], poses.ground_from_image[image, :, 2]
            depth = -(xyz_m[rays.point[near[away.argmin(axis=1)]]] - X0) @ axis
            placed[rays.point[image_rows]] = (
                X0 + rays.directions(poses, image_rows) * (depth / rays.c_mm[image_rows])[:, None]
            )
    return placed
