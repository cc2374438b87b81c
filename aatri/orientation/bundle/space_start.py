"""Start values by collinearity in object space: poses and points together, with control and observed positions.

The conditions of `observations.object_space` do not tell front from behind. An image that comes out with most of its
points behind it is turned over: mirrored on the plane of its points, with u = R'(X - X0) becoming -u, it sees the
same image points, exactly where the ground is flat.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from aatri.adjustment.adjust import adjust_large
from aatri.adjustment.records import Records
from aatri.adjustment.unknowns import Unknowns, add_step
from aatri.arrays import Bool, Float
from aatri.geometry.vectors import finite_rows
from aatri.observations.coordinates import value_records
from aatri.observations.object_space import object_space_records
from aatri.observations.poses import POINT, POSE, Poses, pose_unknowns
from aatri.observations.positions import position_records
from aatri.orientation.bundle.block import BundleInput, determinable

SPACE_ITERATIONS = 60
SPACE_TOLERANCE = 0.1


def start_in_space(given: BundleInput, factor: float, rotations_held: bool) -> BundleInput:
    """The block with poses and points adjusted in object space; cameras at their start, film as measured.

    Parameters
    ----------
    factor : float
        On the standard deviations of the image points.
    rotations_held : bool
        First with rotations held, where the problem is linear, then with all.

    Raises
    ------
    GeometryError, ConvergenceError
    """
    ray, image, point = determinable(given)
    rays = given.rays.take(ray)
    origin = np.round(given.xyz_m[point].mean(axis=0))
    control = given.control
    exact, coordinate = np.nonzero(control.exact)
    xyz = given.xyz_m.copy()
    xyz[control.point[exact], coordinate] = control.xyz_m[exact, coordinate]
    free = np.repeat(point[:, None], 3, axis=1)
    free[control.point[exact], coordinate] = False
    distance = float(np.median(np.linalg.norm(xyz[rays.point] - given.poses.position_m[rays.image], axis=1)))
    records = [object_space_records(rays, distance, factor), *_given_records(given, origin, image, point)]
    state: Any = {POSE: Poses(given.poses.position_m - origin, given.poses.ground_from_image), POINT: xyz - origin}
    for turning in (False, True) if rotations_held else (True,):
        pose = np.repeat(image[:, None], 6, axis=1)
        pose[:, 3:] &= turning
        unknowns = [pose_unknowns(given.image_ids, pose, given.poses.position_m),
                    Unknowns(POINT, free, ("X", "Y", "Z"), given.point_ids, add_step, eliminated=True)]  # fmt: skip
        found = adjust_large(unknowns, records, state, max_iterations=SPACE_ITERATIONS, tolerance=SPACE_TOLERANCE)
        state = found.state
    poses, xyz = found.state[POSE], found.state[POINT] + origin
    poses = Poses(poses.position_m + origin, poses.ground_from_image)
    for k in np.flatnonzero(turned_over(given, poses, xyz, ray)):
        poses = _mirrored(poses, int(k), xyz[given.rays.point[ray & (given.rays.image == k)]])
    return replace(given, poses=poses, xyz_m=np.where(point[:, None], xyz, given.xyz_m))


def turned_over(given: BundleInput, poses: Poses, xyz_m: Float, ray: Bool) -> Bool:
    """Images with more than half of their points behind them.

    Parameters
    ----------
    ray : (n,) bool
        Rays to look at.

    Returns
    -------
    (n_images,) bool
    """
    image, point = given.rays.image[ray], given.rays.point[ray]
    axis = poses.ground_from_image[image][:, :, 2]
    behind = np.einsum("ni,ni->n", axis, xyz_m[point] - poses.position_m[image]) > 0
    n = len(given.image_ids)
    return np.asarray(2 * np.bincount(image[behind], minlength=n) > np.bincount(image, minlength=n))


def _given_records(given: BundleInput, origin: Float, image: Bool, point: Bool) -> list[Records]:
    """Control and observed positions."""
    control, p, records = given.control, given.positions, []
    use = np.flatnonzero(point[control.point] & control.observed.any(axis=1))
    if len(use):
        records.append(value_records("control", POINT, control.point[use], control.xyz_m[use] - origin,
                                     control.covariance_m2[use], control.observed[use]))  # fmt: skip
    seen = np.flatnonzero(image[p.image])
    if len(seen):
        records.append(position_records(p.image[seen], p.position_m[seen] - origin, p.covariance_m2[seen],
                                        p.lever_arm_m[seen]))  # fmt: skip
    return records


def _mirrored(poses: Poses, k: int, xyz_m: Float) -> Poses:
    """An image turned over, mirrored on the plane of its points: there u becomes -u, and x, y stay what they are."""
    centre = xyz_m[finite_rows(xyz_m)].mean(axis=0)
    normal = np.linalg.svd(xyz_m[finite_rows(xyz_m)] - centre)[2][2]
    mirror = np.eye(3) - 2.0 * np.outer(normal, normal)
    position, rotation = poses.position_m.copy(), poses.ground_from_image.copy()
    position[k] = centre + mirror @ (position[k] - centre)
    rotation[k] = -mirror @ rotation[k]
    return Poses(position, rotation)
