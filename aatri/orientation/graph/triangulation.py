"""Points of oriented images from all their rays, and the rays that do not belong.

A point is intersected from its rays (`geometry.intersection`); its ray that is farthest off, by more than the limit, is
left out and the point intersected again, as long as two rays remain that meet at a clear angle. Rays left out are
tested once more in the end. A point behind an image is off by more than any limit.
"""

from __future__ import annotations

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.geometry.intersection import intersect_rays
from aatri.geometry.vectors import finite_rows
from aatri.observations.image_points import ImagePointRows
from aatri.observations.poses import Poses

ROUNDS = 12

LEAST_PARALLAX_RAD = 0.005
"""Points whose rays all lie within a smaller angle are not determined."""


def intersected(
    rays: ImagePointRows, poses: Poses, limit_mm: float, adjusted: Float | None = None
) -> tuple[Float, Bool]:
    """Points of the oriented images.

    Parameters
    ----------
    rays : ImagePointRows
    poses : Poses
        NaN where unknown.
    limit_mm : float, mm
        Of a residual in the image.
    adjusted : (n_points, 3) float64, optional
        Points of a bundle with these poses: they stay where they are; NaN where there is none.

    Returns
    -------
    xyz : (n_points, 3) float64
        NaN where not determined.
    kept : (n,) bool
        Rays that fit their point.
    """
    n_points = max(int(rays.point.max(initial=-1)) + 1, 0 if adjusted is None else len(adjusted))
    oriented = finite_rows(poses.position_m) & finite_rows(poses.ground_from_image)
    use = np.flatnonzero(rays.active & oriented[rays.image])
    image, point = rays.image[use], rays.point[use]
    u = np.column_stack([rays.xy_mm[use], -rays.c_mm[use]])
    direction = np.einsum("nij,nj->ni", poses.ground_from_image[image], u)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    X0, active = poses.position_m[image], np.ones(len(use), dtype=bool)
    xyz = np.full((n_points, 3), np.nan)
    again = np.ones(n_points, dtype=bool)
    for _ in range(ROUNDS):
        rows = np.flatnonzero(active & again[point])
        names, of = np.unique(point[rows], return_inverse=True)
        xyz[again] = np.nan
        xyz[names] = intersect_rays(X0[rows], direction[rows], of, len(names))
        enough = np.bincount(point[active], minlength=n_points) >= 2
        xyz[~enough] = np.nan
        off = residuals_mm(rays, use, poses, xyz)
        worst = _worst(np.where(active, off, -1.0), point, n_points)
        bad = worst[(worst >= 0)]
        bad = bad[off[bad] > limit_mm]
        if not len(bad):
            break
        active[bad] = False
        again = np.zeros(n_points, dtype=bool)
        again[point[bad]] = True
    xyz[narrow(direction, point, active, n_points)] = np.nan
    if adjusted is not None:
        xyz[: len(adjusted)] = np.where(finite_rows(adjusted)[:, None], adjusted, xyz[: len(adjusted)])
    kept = np.zeros(len(rays.image), dtype=bool)
    kept[use] = residuals_mm(rays, use, poses, xyz) <= limit_mm
    return xyz, kept


def residuals_mm(rays: ImagePointRows, rows: Int, poses: Poses, xyz: Float) -> Float:
    """Distance of image points from where their point is seen, mm; inf behind the image, NaN without a point."""
    image, point = rays.image[rows], rays.point[rows]
    w = xyz[point] - poses.position_m[image]
    u = np.einsum("nji,nj->ni", poses.ground_from_image[image], w)
    with np.errstate(divide="ignore", invalid="ignore"):
        v = -rays.c_mm[rows, None] * u[:, :2] / u[:, 2:] - rays.xy_mm[rows]
    return np.asarray(np.where(u[:, 2] >= 0, np.inf, np.linalg.norm(v, axis=1)))


def _worst(size: Float, point: Int, n_points: int) -> Int:
    """The row of the largest size of each point; -1 without rows."""
    order = np.lexsort((np.nan_to_num(size, nan=-1.0), point))
    found = np.full(n_points, -1, dtype=np.int64)
    found[point[order]] = order
    return found


def narrow(direction: Float, point: Int, active: Bool, n_points: int) -> Bool:
    """Points whose rays all lie within a narrow cone."""
    rows = np.flatnonzero(active)
    mean = np.zeros((n_points, 3))
    np.add.at(mean, point[rows], direction[rows])
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-300)
    off = np.linalg.norm(np.cross(direction[rows], mean[point[rows]]), axis=1)
    widest = np.zeros(n_points)
    np.maximum.at(widest, point[rows], off)
    return widest < 0.5 * LEAST_PARALLAX_RAD
