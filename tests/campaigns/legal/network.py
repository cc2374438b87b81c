"""What a block determines, by a dense least-squares network of its own: every observation that is right, at the truth.

    N_cc - N_cp N_pp^-1 N_pc = V L V',    c poses and camera, p points, columns over their length

Eigenvalues of zero are what is open, and it moves points by N_pp^-1 N_pc v. Film is taken as measured, without what its
fiducials leave open.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tests.campaigns.legal.flight import (
    ATTITUDE_DEG,
    CONTROL_M,
    HEIGHT_M,
    IMAGE_MM,
    POSITION_M,
    Float,
    Int,
    Scene,
    true_camera,
)

OPEN = 1e-11
"""Eigenvalues of columns of length 1 below this share of the largest are zero; sums of so many squares have 1e-14."""
MOVED = 1e-4
"""What an open direction of length 1 moves by less than this stays where it is."""
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


def network_of(scene: Scene, *, taken_in: bool = False) -> Network:
    """What the right observations determine; or what they do with wrong control or a wrong position `taken_in`."""
    if taken_in:
        nothing = np.zeros(0, np.int64)
        scene = replace(scene, wrong_control=nothing, wrong_positions=nothing)
    n, points = len(scene.R), len(scene.xyz_m)
    rows = np.setdiff1d(np.arange(len(scene.xy_mm)), scene.wrong_rays)
    rows = _seen_twice(scene, rows[scene.true_rays.point[rows] != scene.far_point])
    image, point = scene.true_rays.image[rows], scene.true_rays.point[rows]
    of_pose, of_camera, of_point = _of_rays(scene, rows)
    columns = np.concatenate([6 * image[:, None] + np.arange(6), np.tile(6 * n + np.arange(4), (len(rows), 1))], axis=1)
    A = np.concatenate([of_pose, of_camera], axis=2)
    cc, cp, pp = np.zeros((6 * n + 4, 6 * n + 4)), np.zeros((points, 6 * n + 4, 3)), np.zeros((points, 3, 3))
    np.add.at(cc, (columns[:, :, None], columns[:, None, :]), np.einsum("mki,mkj->mij", A, A))
    np.add.at(cp, (point[:, None], columns), np.einsum("mki,mkj->mij", A, of_point))
    np.add.at(pp, point, np.einsum("mki,mkj->mij", of_point, of_point))
    _observed_on_the_ground(scene, cc, pp)
    seen = np.flatnonzero(np.einsum("nii->n", pp) > 0)
    inverse = np.linalg.inv(pp[seen])
    back = np.einsum("nij,nkj->nik", inverse, cp[seen])  # of a point by the poses, but for the sign
    reduced = cc - np.einsum("nij,njk->ik", cp[seen], back)
    used = np.flatnonzero(np.diag(cc) > 0)
    length = np.sqrt(np.diag(cc)[used])
    values, V = np.linalg.eigh(reduced[np.ix_(used, used)] / np.outer(length, length))
    none = values < OPEN * values[-1]
    open_, root = V[:, none] / length[:, None], V[:, ~none] / np.sqrt(values[~none]) / length[:, None]
    turned = open_ * np.where(used % 6 > 2, HEIGHT_M, 1.0)[:, None]  # what an angle moves on the ground
    whole = np.abs(turned).max(initial=1.0)
    C = inverse + np.einsum("nij,njk->nik", back[:, :, used] @ root, (back[:, :, used] @ root).transpose(0, 2, 1))
    of_points, of_images = np.full((points, 3), np.nan), np.full((6 * n + 4), np.nan)
    fast = np.abs(back[:, :, used] @ open_).max(axis=(1, 2), initial=0.0) if none.any() else np.zeros(len(seen))
    still = fast < MOVED * whole
    of_points[seen[still]] = np.sqrt(np.einsum("nii->ni", C[still]))
    firm = np.abs(turned).max(axis=1, initial=0.0) < MOVED * whole
    of_images[used[firm]] = np.sqrt((root[firm] ** 2).sum(axis=1))
    poses = of_images[: 6 * n].reshape(n, 6)
    weak = bool(np.nanmax(of_points, initial=0.0) > WEAK * HEIGHT_M)
    return Network(
        np.flatnonzero(np.isfinite(poses).all(axis=1)),
        np.flatnonzero(np.isfinite(of_points).all(axis=1)),
        of_points,
        _size(scene, poses[:, :3], of_points),
        weak,
    )


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
    often[np.delete(scene.control, scene.wrong_control)] += 2
    return rows[often[scene.true_rays.point[rows]] > 1]


def _of_rays(scene: Scene, rows: Int) -> tuple[Float, Float, Float]:
    """Derivatives (m, 2, 6), (m, 2, 4), (m, 2, 3) of x = -c u1 / u3 by pose, c x0 y0 k1 and point, over sigma."""
    image, point = scene.true_rays.image[rows], scene.true_rays.point[rows]
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
    of_camera = np.zeros((len(rows), 2, 4))
    if scene.cell.parameters == "free":
        of_camera[:, :, 0] = x / c
        of_camera[:, 0, 1] = of_camera[:, 1, 2] = 1.0
        of_camera[:, :, 3] = -x * (x**2).sum(axis=1)[:, None]
    return np.concatenate([-of_point, of_point @ cross], axis=2) / sigma, of_camera / sigma, of_point / sigma


def _observed_on_the_ground(scene: Scene, cc: Float, pp: Float) -> None:
    """Weights of control, positions and attitudes, but for the wrong ones."""
    for point in np.delete(scene.control, scene.wrong_control):
        pp[point] += np.diag(1 / np.square(CONTROL_M))
    place = np.arange(6 * len(scene.R)).reshape(-1, 6)
    at = place[np.delete(scene.positioned, scene.wrong_positions), :3].ravel()
    cc[at, at] += POSITION_M**-2
    if len(scene.angles_deg):
        at = place[:, 3:].ravel()
        cc[at, at] += np.radians(ATTITUDE_DEG) ** -2
