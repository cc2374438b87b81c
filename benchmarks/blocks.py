"""Blocks of arrays for benchmarks: aerial blocks with terrain, tilts, noise, GNSS positions and a disturbed start."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from aatri.arrays import Float, Int
from aatri.geometry.rotations import exp_rotation, rotation_from_angles


@dataclass(frozen=True)
class ArrayBlock:
    """A block of n images, p points and m rays.

    Attributes
    ----------
    c_mm : float, mm
    image, point : (m,) int32
    xy_mm : (m, 2) float64, mm
    sigma_mm : float, mm
    position_m, xyz_m : start of the projection centres (n, 3) and points (p, 3), m
    ground_from_image : (n, 3, 3) float64
        Start of the rotations.
    gnss_m : (n, 3) float64, m
    gnss_sigma_m : float, m
    """

    c_mm: float
    image: Int
    point: Int
    xy_mm: Float
    sigma_mm: float
    position_m: Float
    ground_from_image: Float
    xyz_m: Float
    gnss_m: Float
    gnss_sigma_m: float


UAV = {
    "overlaps": (0.8, 0.6),
    "c_mm": 8.8,
    "format_mm": 13.2,
    "scale": 11000.0,
    "sigma_mm": 0.0012,
    "start": (1.0, 0.01),
}
FILM = {
    "overlaps": (0.6, 0.3),
    "c_mm": 153.84,
    "format_mm": 230.0,
    "scale": 2500.0,
    "sigma_mm": 0.005,
    "start": (2.0, 0.02),
}
BLOCKS = {
    "film": {"strips": 9, "images": 28, "points_per_image": 30, **FILM},
    "uav1k": {"strips": 25, "images": 40, "points_per_image": 300, **UAV},
    "uav1kd": {"strips": 25, "images": 40, "points_per_image": 1000, **UAV},
    "uav4k": {"strips": 50, "images": 80, "points_per_image": 300, **UAV},
    "uav16k": {"strips": 100, "images": 160, "points_per_image": 300, **UAV},
}
"""Sizes: 252 film images; 1,000 images with 300 and 1,000 points each; 4,000; 16,000."""


def made_block(
    strips: int,
    images: int,
    points_per_image: int,
    overlaps: tuple[float, float],
    c_mm: float,
    format_mm: float,
    scale: float,
    sigma_mm: float,
    start: tuple[float, float],
    seed: int = 0,
    gnss_sigma_m: float = 0.05,
) -> ArrayBlock:
    """Make a block; `start` disturbs positions (m, twice that for points) and rotations (rad)."""
    rng = np.random.default_rng(seed)
    height, side = c_mm * scale / 1e3, format_mm * scale / 1e3
    along, across = np.meshgrid(np.arange(images), np.arange(strips), indexing="xy")
    X0 = np.stack(
        [along * side * (1 - overlaps[0]), across * side * (1 - overlaps[1]), np.full(along.shape, height)], -1
    )
    X0 = X0.reshape(-1, 3) + rng.normal(0, 0.01 * height, (along.size, 3))
    kappa = np.where(across.ravel() % 2 == 0, 0.0, np.pi)
    angles = np.radians(2.0) * rng.normal(size=(len(X0), 3)) + np.column_stack([0 * kappa, 0 * kappa, kappa])
    R = rotation_from_angles(angles)
    image, point, xy, X = _measured(rng, X0, R, points_per_image, c_mm, format_mm, side)
    xy += rng.normal(0, sigma_mm, xy.shape)
    turn = exp_rotation(rng.normal(0, start[1], (len(X0), 3)))
    return ArrayBlock(
        c_mm,
        image,
        point,
        xy,
        sigma_mm,
        X0 + rng.normal(0, start[0], X0.shape),
        turn @ R,
        X + rng.normal(0, 2 * start[0], X.shape),
        X0 + rng.normal(0, gnss_sigma_m, X0.shape),
        gnss_sigma_m,
    )


def _measured(rng: np.random.Generator, X0: Float, R: Float, per_image: int, c: float, format_mm: float, side: float):
    low, high = X0[:, :2].min(axis=0) - side / 2, X0[:, :2].max(axis=0) + side / 2
    n = int(len(X0) * per_image * np.prod(high - low) / (len(X0) * side**2))
    X = np.column_stack([rng.uniform(low, high, (n, 2)), np.zeros(n)])
    height = X0[:, 2].mean()
    X[:, 2] = 0.1 * height * np.sin(X[:, 0] / (3 * side)) * np.cos(X[:, 1] / (2.3 * side)) + rng.normal(
        0, 0.02 * height, n
    )
    near = cKDTree(X[:, :2]).query_ball_point(X0[:, :2], 0.8 * side)
    image = np.repeat(np.arange(len(X0)), [len(k) for k in near])
    point = np.concatenate([np.asarray(k, dtype=np.int64) for k in near])
    u = np.einsum("nji,nj->ni", R[image], X[point] - X0[image])
    xy = -c * u[:, :2] / u[:, 2:]
    inside = (np.abs(xy) < 0.485 * format_mm).all(axis=1)
    image, point, xy = image[inside], point[inside], xy[inside]
    seen = np.bincount(point, minlength=n) >= 2
    keep = seen[point]
    number = np.cumsum(seen) - 1
    return image[keep].astype(np.int32), number[point[keep]].astype(np.int32), xy[keep], X[seen]
