"""Start values a bundle adjustment still lacks: points by intersection, images by resection.

Points without coordinates are intersected from the oriented images; images without orientation get one from the known
points they see, by what is offered (a position, an orientation) or a closed three-point start, and a resection, if the
points agree with it more than by chance (`resection.start`). Both are repeated while they find anything new.
"""

from __future__ import annotations

import numpy as np

from aatri.arrays import Bool, Float
from aatri.geometry.intersection import intersect_rays
from aatri.geometry.vectors import finite_rows
from aatri.observations.image_points import ImagePointRows
from aatri.observations.poses import Poses
from aatri.orientation.resection.adjustment import resect_images
from aatri.orientation.resection.linear import FEWEST, linear_orientation
from aatri.orientation.resection.start import start_orientation


def complete_start(
    rays: ImagePointRows, poses: Poses, xyz_m: Float, *, linear: bool = False, offered: Poses | None = None
) -> tuple[Poses, Float]:
    """Fill in what is missing and can be computed; what is known is left alone.

    Parameters
    ----------
    rays : ImagePointRows
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
        xyz_m = _intersected(rays, poses, xyz_m)
        completed = _resected(rays, poses, xyz_m, linear, offered or poses)
        if (_oriented(completed) == _oriented(poses)).all():
            return completed, xyz_m
        poses = completed


def _intersected(rays: ImagePointRows, poses: Poses, xyz_m: Float) -> Float:
    missing = ~finite_rows(xyz_m)
    use = rays.active & missing[rays.point] & _oriented(poses)[rays.image]
    looking = np.column_stack([rays.xy_mm[use], -rays.c_mm[use]])
    direction = np.einsum("nij,nj->ni", poses.ground_from_image[rays.image[use]], looking)
    found = intersect_rays(poses.position_m[rays.image[use]], direction, rays.point[use], len(xyz_m))
    return np.asarray(np.where(missing[:, None], found, xyz_m))


def _resected(rays: ImagePointRows, poses: Poses, xyz_m: Float, linear: bool, offered: Poses) -> Poses:
    position, rotation = poses.position_m.copy(), poses.ground_from_image.copy()
    missing = ~_oriented(poses)
    rows = np.flatnonzero(rays.active & finite_rows(xyz_m)[rays.point] & missing[rays.image])
    rows = rows[np.argsort(rays.image[rows], kind="stable")]
    images, first = np.unique(rays.image[rows], return_index=True)
    start_position, start_rotation = np.full_like(position, np.nan), np.full_like(rotation, np.nan)
    for image, mine in zip(images, np.split(rows, first[1:])):
        seen = rays.xy_mm[mine], float(rays.c_mm[mine][0]), xyz_m[rays.point[mine]]
        by_six = linear_orientation(*seen) if linear else None
        start = start_orientation(
            *seen, area_mm2=_area_mm2(rays, seen[1]), others=() if by_six is None else ((FEWEST, by_six),),
            offered=(offered.position_m[image], offered.ground_from_image[image]),
        )  # fmt: skip
        if start is not None:
            start_position[image], start_rotation[image] = start
    c_mm = np.ones(len(position))
    c_mm[images] = rays.c_mm[rows[first]]
    result = resect_images(
        rays.xy_mm[rows], rays.sigma_mm[rows], rays.image[rows], rays.point[rows], c_mm, xyz_m,
        start_position, start_rotation,
    )  # fmt: skip
    found = result.resected & finite_rows(start_position)
    position[found], rotation[found] = result.position_m[found], result.ground_from_image[found]
    return Poses(position, rotation)


def _area_mm2(rays: ImagePointRows, c_mm: float) -> float:
    """What the points of all images of one principal distance cover."""
    return float(np.prod(np.ptp(rays.xy_mm[rays.c_mm == c_mm], axis=0)))


def _oriented(poses: Poses) -> Bool:
    """Images with a position and a rotation: a position alone, from GNSS, lets no point be intersected."""
    return finite_rows(poses.position_m) & finite_rows(poses.ground_from_image)
