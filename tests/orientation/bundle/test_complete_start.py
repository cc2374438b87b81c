"""What a bundle's start lacks: images resected on known points, all that can be at once."""

from __future__ import annotations

import numpy as np

from aatri.geometry.rotations import rotation_from_angles
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.poses import Poses
from aatri.orientation.bundle.complete_start import complete_start

C_MM = 150.0


def test_images_and_points_without_start_follow_from_those_that_have_one() -> None:
    rng = np.random.default_rng(1)
    n_images, n_points = 7, 40
    X0 = np.column_stack([200.0 * np.arange(n_images), rng.normal(0, 5, n_images), np.full(n_images, 1000.0)])
    R = rotation_from_angles(rng.normal(0, 0.05, (n_images, 3)))
    xyz = rng.uniform([-100, -500, -80], [1400, 500, 80], (n_points, 3))
    image, point = (a.ravel().astype(np.int32) for a in np.indices((n_images, n_points)))
    u = np.einsum("nji,nj->ni", R[image], xyz[point] - X0[image])
    xy = -C_MM * u[:, :2] / u[:, 2:]
    active = np.ones(len(xy), dtype=bool)
    active[(image == 6) & (point >= 3)] = False  # three points make no start
    wrong = np.flatnonzero((image == 4) & (point == 5))
    xy[wrong] += 90.0
    active[wrong] = False
    order = rng.permutation(len(xy))
    rays = ImagePointRows(image, point, xy, np.full(xy.shape, 0.01), np.full(len(xy), C_MM), np.zeros(xy.shape), active)
    start_X0, start_R, start_xyz = X0.copy(), R.copy(), np.full_like(xyz, np.nan)
    start_X0[2:], start_R[4:] = np.nan, np.nan
    poses, found = complete_start(rays.take(order), Poses(start_X0, start_R), start_xyz)
    np.testing.assert_allclose(found, xyz, atol=1e-6)
    np.testing.assert_allclose(poses.position_m[:6], X0[:6], atol=1e-6)
    np.testing.assert_allclose(poses.ground_from_image[:6], R[:6], atol=1e-9)
    assert np.isnan(poses.position_m[6]).all()


def test_images_that_see_no_known_point_start_where_they_are_offered_if_their_rays_meet() -> None:
    rng = np.random.default_rng(2)
    X0 = np.column_stack([200.0 * np.arange(3), np.zeros(3), np.full(3, 1000.0)])
    R = rotation_from_angles(rng.normal(0, 0.05, (3, 3)))
    xyz = rng.uniform([-200, -300, -80], [600, 300, 80], (12, 3))
    image, point = (a.ravel().astype(np.int32) for a in np.indices((3, 12)))
    u = np.einsum("nji,nj->ni", R[image], xyz[point] - X0[image])
    xy = -C_MM * u[:, :2] / u[:, 2:]
    rays = ImagePointRows(
        image,
        point,
        xy,
        np.full(xy.shape, 0.01),
        np.full(len(xy), C_MM),
        np.zeros(xy.shape),
        np.ones(len(xy), dtype=bool),
    )
    nothing = Poses(np.full((3, 3), np.nan), np.full((3, 3, 3), np.nan))
    offered = Poses(X0 + rng.normal(0, 0.1, (3, 3)), R)
    poses, found = complete_start(rays, nothing, np.full((12, 3), np.nan), offered=offered)
    np.testing.assert_allclose(poses.position_m, X0, atol=0.5)
    np.testing.assert_allclose(found, xyz, atol=3.0)
    turned = R.copy()
    turned[1] = rotation_from_angles(np.array([[0.4, 0.0, 0.0]]))[0] @ R[1]
    poses, _ = complete_start(rays, nothing, np.full((12, 3), np.nan), offered=Poses(X0, turned))
    assert np.isnan(poses.position_m[1]).all() or np.linalg.norm(poses.ground_from_image[1] - R[1]) < 0.01
    np.testing.assert_allclose(poses.position_m[[0, 2]], X0[[0, 2]], atol=0.5)
