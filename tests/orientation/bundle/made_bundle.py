"""A small vertical block made by hand: images in two strips, a flat field of points with some relief, noisy rays."""

from __future__ import annotations

import numpy as np

from aatri.geometry.rotations import exp_rotation
from aatri.observations.control import Control
from aatri.observations.image_point_rows import ImagePointRows
from aatri.observations.poses import Poses
from aatri.observations.positions import Positions
from tests.orientation.bundle.parts import Parts

C_MM, SIGMA_MM, HEIGHT_M = 150.0, 0.01, 1500.0


def made_bundle(seed: int = 0, *, start_error: float = 1.0) -> Parts:
    """Six images, 30 points, no control; the start is off by some metres and milliradians."""
    rng = np.random.default_rng(seed)
    position = np.array([[x, y, HEIGHT_M] for y in (0.0, 900.0) for x in (0.0, 600.0, 1200.0)])
    rotation = exp_rotation(rng.normal(scale=0.02, size=(6, 3)))
    xyz = rng.uniform([-400, -500, -60], [1600, 1400, 60], size=(30, 3))
    image, point = (a.ravel() for a in np.indices((6, 30)))
    u = np.einsum("nji,nj->ni", rotation[image], xyz[point] - position[image])
    xy = -C_MM * u[:, :2] / u[:, 2:]
    seen = (np.abs(xy) < 115).all(axis=1)
    image, point, xy = image[seen].astype(np.int32), point[seen].astype(np.int32), xy[seen]
    n = len(xy)
    rays = ImagePointRows(
        image,
        point,
        xy + rng.normal(scale=SIGMA_MM, size=xy.shape),
        np.full((n, 2), SIGMA_MM),
        np.full(n, C_MM),
        np.zeros((n, 2)),
        np.ones(n, bool),
    )
    poses = Poses(
        position + start_error * rng.normal(size=position.shape),
        exp_rotation(1e-3 * start_error * rng.normal(size=(6, 3))) @ rotation,
    )
    return Parts(
        [f"i{k}" for k in range(6)],
        [f"p{k}" for k in range(30)],
        rays,
        poses,
        xyz + start_error * rng.normal(size=xyz.shape),
        no_control(),
        no_positions(),
    )


def no_control() -> Control:
    nothing = np.zeros((0, 3), dtype=bool)
    return Control(
        np.zeros(0, np.int32), np.zeros(0, np.int32), np.zeros((0, 3)), np.zeros((0, 3, 3)), nothing, nothing
    )


def no_positions() -> Positions:
    return Positions(
        np.zeros(0, np.int32), np.zeros(0, np.int32), np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros((0, 3))
    )
