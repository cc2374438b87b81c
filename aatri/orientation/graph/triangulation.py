"""Points of oriented images from all their rays, and the rays that do not belong.

A point is intersected from its rays (`geometry.intersection`); its ray that is farthest off, by more than the limit, is
left out and the point intersected again, as long as two rays remain that meet at a clear angle. Rays left out are
tested once more in the end. A point behind an image is off by more than any limit.
"""

import numpy as np

from aatri.arrays import Bool, Float, Int, finite_rows
from aatri.geometry.intersection import intersect_rays
from aatri.geometry.vectors import unit
from aatri.observations.image_point_rows import ImagePointRows, residuals_mm
from aatri.observations.poses import Poses
from aatri.orientation.graph.limits import LEAST_PARALLAX_RAD, TRIM_LIMIT

ROUNDS = 12


def intersected(
    rays: ImagePointRows, poses: Poses, limit_mm: float, adjusted: Float | None = None
) -> tuple[Float, Bool]:
    """Points of the oriented images.

    Parameters
    ----------
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
    use = np.flatnonzero(rays.active & poses.oriented[rays.image])
    image, point = rays.image[use], rays.point[use]
    direction = unit(rays.directions(poses, use))
    X0, active = poses.position_m[image], np.ones(len(use), dtype=bool)
    xyz = np.full((n_points, 3), np.nan)
    changed = np.ones(n_points, dtype=bool)
    for _ in range(ROUNDS):
        changed_rays = np.flatnonzero(changed[point])  # all others stay as they are
        rows = changed_rays[active[changed_rays]]
        names, place = np.unique(point[rows], return_inverse=True)
        xyz[changed] = np.nan
        xyz[names] = intersect_rays(X0[rows], direction[rows], place, len(names))
        enough = np.bincount(point[active], minlength=n_points) >= 2
        xyz[~enough] = np.nan
        off = residuals_mm(rays, use[changed_rays], poses, xyz)
        worst = _worst(np.where(active[changed_rays], off, -1.0), point[changed_rays], n_points)
        worst = worst[worst >= 0]
        bad = changed_rays[worst[off[worst] > limit_mm]]
        if not len(bad):
            break
        active[bad] = False
        changed = np.zeros(n_points, dtype=bool)
        changed[point[bad]] = True
    xyz[narrow(direction, point, active, n_points)] = np.nan
    if adjusted is not None:
        xyz[: len(adjusted)] = np.where(finite_rows(adjusted)[:, None], adjusted, xyz[: len(adjusted)])
    kept = np.zeros(len(rays.image), dtype=bool)
    kept[use] = residuals_mm(rays, use, poses, xyz) <= limit_mm
    return xyz, kept


def contradicting(rays: ImagePointRows, poses: Poses, xyz: Float, spread: float) -> Int:
    """Rays of points that are not determined though several oriented images see them, as these rays do not meet.

    Parameters
    ----------
    xyz : (n_points, 3) float64
        NaN where not determined.
    spread : float
        Of the residuals, in standard deviations.

    Returns
    -------
    (k,) int
        Rows of the rays. Points whose rays meet, but at too narrow an angle, are not among them.
    """
    rows = np.flatnonzero(rays.active & poses.oriented[rays.image] & ~finite_rows(xyz)[rays.point])
    rows = rows[np.bincount(rays.point[rows], minlength=len(xyz))[rays.point[rows]] >= 2]
    if not len(rows):
        return rows
    direction = unit(rays.directions(poses, rows))
    names, place = np.unique(rays.point[rows], return_inverse=True)
    met = np.full(xyz.shape, np.nan)
    met[names] = intersect_rays(poses.position_m[rays.image[rows]], direction, place, len(names))
    off = residuals_mm(rays, rows, poses, met) / rays.sigma_mm[rows].mean(axis=1)
    far = np.bincount(place, ~(off <= TRIM_LIMIT * max(spread, 1.0))) > 0
    return rows[far[place]]


def _worst(size: Float, point: Int, n_points: int) -> Int:
    """The row of the largest size of each point; -1 without rows."""
    order = np.lexsort((np.nan_to_num(size, nan=-1.0), point))
    worst_row = np.full(n_points, -1, dtype=np.int64)
    worst_row[point[order]] = order
    return worst_row


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
