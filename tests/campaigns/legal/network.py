"""What a block determines, by a dense least-squares network of its own: every observation that is right, at the truth.

    J d = e,    whitened: rows over their true standard deviations, columns over their length

What the null space of J moves is open. Film is taken as measured, without what its fiducials leave open.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tests.campaigns.legal.flight import (
    ATTITUDE_DEG,
    CAMERAS,
    CONTROL_M,
    HEIGHT_M,
    IMAGE_MM,
    POSITION_M,
    Float,
    Int,
    Scene,
    true_camera,
)

OPEN = 1e-7
"""Singular values of columns of length 1 below this share of the largest are zero."""
WEAK = 0.1
"""Share of the flying height beyond which a standard deviation means that nothing is known."""


@dataclass(frozen=True)
class Network:
    """What is determined of a block, and how well.

    Attributes
    ----------
    images, points : ndarray
        Rows that all right observations together determine.
    sigma_m : ndarray
        (n, 3) of the points determined, true standard deviations; NaN elsewhere.
    size : float
        Largest coordinate of the wrong control or position against its prediction, in standard deviations.
    weak : bool
        Some sigma is beyond a tenth of the flying height.
    """

    images: Int
    points: Int
    sigma_m: Float
    size: float
    weak: bool


def network_of(scene: Scene) -> Network:
    """Determine what the block determines."""
    rows = np.setdiff1d(np.arange(len(scene.xy_mm)), scene.wrong_rays)
    rows = rows[scene.true_rays.point[rows] != scene.far_point]
    rows = _seen_twice(scene, rows)
    J = np.vstack([_of_rays(scene, rows), *_of_ground(scene)])
    J = J * _units(scene)
    used = np.flatnonzero(np.abs(J).max(axis=0) > 0)
    scale = np.linalg.norm(J[:, used], axis=0)
    values, V = np.linalg.svd(J[:, used] / scale, full_matrices=True)[1:]
    values = np.concatenate([values, np.zeros(len(V) - len(values))])
    none = values < OPEN * values[0]
    moved, sigma = np.zeros(J.shape[1]), np.full(J.shape[1], np.nan)
    moved[used] = np.abs(V[none]).max(axis=0, initial=0.0)
    sigma[used] = np.sqrt(((V[~none].T / values[~none]) ** 2).sum(axis=1)) / scale * _units(scene)[used]
    n = len(scene.R)
    known = np.isfinite(sigma) & (moved < 1e-4)
    images, points = (known[: 6 * n].reshape(n, 6), known[6 * n : -4].reshape(-1, 3))
    of_points = np.where(known, sigma, np.nan)[6 * n : -4].reshape(-1, 3)
    of_images = np.where(known, sigma, np.nan)[: 6 * n].reshape(n, 6)[:, :3]
    weak = bool(np.nanmax(of_points, initial=0.0) > WEAK * HEIGHT_M)
    size = _size(scene, of_images, of_points)
    return Network(np.flatnonzero(images.all(axis=1)), np.flatnonzero(points.all(axis=1)), of_points, size, weak)


def _size(scene: Scene, of_images: Float, of_points: Float) -> float:
    """The wrong control or position less its prediction by all others, in standard deviations; 0: not predicted."""
    if len(scene.wrong_control):
        row, stated = scene.wrong_control[0], np.array(CONTROL_M)
        point = scene.control[row]
        off, predicted = scene.control_m[row] - scene.xyz_m[point], of_points[point]
    elif len(scene.wrong_positions):
        row, stated = scene.wrong_positions[0], np.full(3, POSITION_M)
        image = scene.positioned[row]
        off, predicted = scene.positions_m[row] - scene.position_m[image], of_images[image]
    else:
        return 0.0
    return float(np.nan_to_num(np.abs(off) / np.hypot(stated, predicted)).max())


def _seen_twice(scene: Scene, rows: Int) -> Int:
    """Rays of points that two images see, or that are control."""
    often = np.bincount(scene.true_rays.point[rows], minlength=len(scene.xyz_m))
    often[np.setdiff1d(scene.control, scene.control[scene.wrong_control])] += 2
    return rows[often[scene.true_rays.point[rows]] > 1]


def _units(scene: Scene) -> Float:
    """Columns: 6 of an image (m, rad), 3 of a point (m), c x0 y0 k1."""
    n, half = len(scene.R), CAMERAS[scene.cell.camera][1]
    return np.concatenate([np.tile([1, 1, 1, 1e-3, 1e-3, 1e-3], n), np.ones(3 * len(scene.xyz_m)),
                           [0.1, 0.1, 0.1, 0.1 / half**3]])  # fmt: skip


def _of_rays(scene: Scene, rows: Int) -> Float:
    """Two rows each, x = -c u1 / u3 with c, x0, y0, k1 where they are free."""
    image, point, n = scene.true_rays.image[rows], scene.true_rays.point[rows], len(scene.R)
    c, sigma = true_camera(scene.cell)["c"], IMAGE_MM[scene.cell.camera]
    R, d = scene.R[image], scene.xyz_m[point] - scene.position_m[image]
    u = np.einsum("nji,nj->ni", R, d)
    x = -c * u[:, :2] / u[:, 2:]
    of_u = np.zeros((len(rows), 2, 3))
    of_u[:, 0, 0] = of_u[:, 1, 1] = -c / u[:, 2]
    of_u[:, :, 2] = -x / u[:, 2:]
    of_point = of_u @ R.transpose(0, 2, 1)
    cross = np.zeros((len(rows), 3, 3))  # u = R' (1 - [w]x) d: du/dw = R' [d]x
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -d[:, 2], d[:, 1], -d[:, 0]
    cross -= cross.transpose(0, 2, 1)
    of_turn = of_point @ cross
    J = np.zeros((len(rows), 2, 6 * n + 3 * len(scene.xyz_m) + 4))
    at = np.arange(len(rows))
    for k in range(3):
        J[at, :, 6 * image + k] = -of_point[:, :, k]
        J[at, :, 6 * image + 3 + k] = of_turn[:, :, k]
        J[at, :, 6 * n + 3 * point + k] = of_point[:, :, k]
    if scene.cell.parameters == "free":
        J[:, :, -4] = x / c
        J[:, 0, -3] = J[:, 1, -2] = 1.0
        J[:, :, -1] = -x * (x**2).sum(axis=1)[:, None]
    return np.asarray(J.reshape(2 * len(rows), -1) / sigma)


def _of_ground(scene: Scene) -> list[Float]:
    """Control, positions and attitudes, each over its standard deviation; the wrong ones come last of their kind."""
    n, columns = len(scene.R), 6 * len(scene.R) + 3 * len(scene.xyz_m) + 4
    made = []
    right = np.setdiff1d(np.arange(len(scene.control)), scene.wrong_control)
    for point in scene.control[right]:
        made.append(_rows(columns, 6 * n + 3 * int(point), np.array(CONTROL_M)))
    for image in np.delete(scene.positioned, scene.wrong_positions):
        made.append(_rows(columns, 6 * int(image), np.full(3, POSITION_M)))
    for image in range(len(scene.angles_deg)):
        made.append(_rows(columns, 6 * image + 3, np.full(3, np.radians(ATTITUDE_DEG))))
    return made


def _rows(columns: int, first: int, sigma: Float) -> Float:
    J = np.zeros((3, columns))
    J[range(3), range(first, first + 3)] = 1 / sigma
    return J
