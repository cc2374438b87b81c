"""Start values by collinearity in object space: poses and points together, with control and observed positions.

The conditions of `observations.object_space` do not tell front from behind. An image that comes out with most of its
points behind it is turned over: mirrored on the plane of its points, with u = R'(X - X0) becoming -u, it sees the
same image points, exactly where the ground is flat.
"""

from dataclasses import replace

import numpy as np

from aatri.adjustment.records import CHUNK
from aatri.adjustment.stepping.adjust import adjust_large
from aatri.arrays import Bool, Float, Int, finite_rows
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.object_space import object_space_records
from aatri.observations.poses import POINT, POSE, Poses
from aatri.orientation.bundle.block import BundleInput, Participants, taking_part, unknowns_of
from aatri.orientation.bundle.result import BundleResult

SPACE_ITERATIONS = 60
SPACE_TOLERANCE = 0.1


def start_in_space(inputs: BundleInput, factor: float, rotations_held: bool) -> BundleInput:
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
    assert inputs.rays is not None
    part = taking_part(inputs)
    image, point = part.of[POSE], part.of[POINT]
    rays = inputs.rays.take(_ray_rows(inputs, part))
    other_records = [
        o.records.take(rows)
        for o, rows in zip(inputs.observed, part.rows)
        if len(rows) and not o.exact and o.records.groups < {POSE, POINT}
    ]
    state = part.start
    distance = float(np.median(np.linalg.norm(state[POINT][rays.point] - inputs.poses.position_m[rays.image], axis=1)))
    records = [object_space_records(rays, distance, factor), *other_records]
    for turning in (False, True) if rotations_held else (True,):
        pose = np.repeat(image[:, None], 6, axis=1)
        pose[:, 3:] &= turning
        unknowns = [u for u in unknowns_of(inputs, part, pose, inputs.poses.position_m) if u.name in (POSE, POINT)]
        solved = adjust_large(unknowns, records, state, max_iterations=SPACE_ITERATIONS, tolerance=SPACE_TOLERANCE)
        state = solved.state
    poses, xyz = solved.state[POSE], solved.state[POINT]
    for k in np.flatnonzero(images_turned_over(rays, poses, xyz)):
        poses = _mirrored(poses, int(k), xyz[rays.point[rays.image == k]])
    return replace(inputs, poses=poses, xyz_m=np.where(point[:, None], xyz, inputs.xyz_m))


def turned_over(rays: ImagePointRows | None, result: BundleResult) -> Bool:
    """Images with more than half of their points behind them, (n_images,) bool."""
    if rays is None:
        return np.zeros(len(result.image_adjusted), dtype=bool)
    return images_turned_over(rays, result.poses, result.xyz_m, result.ray_used)


def images_turned_over(rays: ImagePointRows, poses: Poses, xyz_m: Float, used: Bool | None = None) -> Bool:
    """The same for given orientations and points, by some of the rays or all."""
    n, axis = len(poses.position_m), poses.ground_from_image[:, :, 2]
    points, behind = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
    for first in range(0, len(rays.image), CHUNK):  # those of all rays together would be more than all that is kept
        chunk = slice(first, first + CHUNK)
        image, point = (a[chunk] if used is None else a[chunk][used[chunk]] for a in (rays.image, rays.point))
        depth = np.einsum("ni,ni->n", axis[image], xyz_m[point] - poses.position_m[image])
        points += np.bincount(image, minlength=n)
        behind += np.bincount(image[depth > 0], minlength=n)
    return np.asarray(2 * behind > points)


def _ray_rows(inputs: BundleInput, part: Participants) -> Int:
    """Rows of the image points in use."""
    for o, rows in zip(inputs.observed, part.rows):
        if {POSE, POINT} <= o.records.groups:
            return rows[o.records.active[rows]]
    return np.zeros(0, dtype=np.int64)


def _mirrored(poses: Poses, k: int, xyz_m: Float) -> Poses:
    """An image turned over, mirrored on the plane of its points: there u becomes -u, and x, y stay what they are."""
    centre = xyz_m[finite_rows(xyz_m)].mean(axis=0)
    normal = np.linalg.svd(xyz_m[finite_rows(xyz_m)] - centre)[2][2]
    mirror = np.eye(3) - 2.0 * np.outer(normal, normal)
    position, rotation = poses.position_m.copy(), poses.ground_from_image.copy()
    position[k] = centre + mirror @ (position[k] - centre)
    rotation[k] = -mirror @ rotation[k]
    return Poses(position, rotation)
