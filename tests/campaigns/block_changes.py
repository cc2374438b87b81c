"""Small digital blocks, and what is taken from them or left free."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from aatri.artifacts.block import Block
from aatri.codes import ANTENNA, CONTROL, NO_ROLE
from aatri.geometry.rotations import angles_from_rotation
from tests.stages.chain import simulated


def digital(seed: int = 3, *, gnss: bool = False, **more: Any) -> Block:
    """A small block of digital images; positions are approximate unless they are wanted as observations."""
    given: dict[str, Any] = {
        "preset": "rc30",
        "flight": {"strips": 3, "images_per_strip": 5, "cross_strips": 0},
        "camera": {"kind": "digital", "distortion": "none", "format": (20000.0, 20000.0), "pixel_size_mm": 0.0115},
        "earth": "flat",
        "refraction": "none",
        "ties": {"new_points": 120},
        "known": {"full": 12},
        "gnss": {"observed": gnss},
    }
    for name, value in more.items():
        given[name] = {**given[name], **value} if isinstance(given.get(name), dict) else value
    return with_approximate_angles(simulated(seed, **given))


def with_approximate_angles(block: Block) -> Block:
    """Angles of the truth as start values, so that no start has to be found."""
    truth, e = block.true_images, block.exterior
    assert truth is not None
    R = np.empty((len(block.images), 3, 3))
    R[truth.image] = truth.ground_from_image
    angles = angles_from_rotation(R[e.image], block.rotation)  # type: ignore[arg-type]
    return replace(block, exterior=replace(e, angles_rad=angles))


def with_control(block: Block, keep: Callable[[np.ndarray], np.ndarray], axes: tuple[int, ...] = (0, 1, 2)) -> Block:
    """The block with some of its control points, in some coordinates; the others are new points."""
    g = block.ground_points
    control = np.flatnonzero((g.role == CONTROL).any(axis=1))
    kept = np.zeros(len(g), dtype=bool)
    kept[control[keep(g.xyz_m[control])]] = True
    role = np.where(kept[:, None] & np.isin(np.arange(3), axes), CONTROL, NO_ROLE).astype(np.int32)
    return replace(block, ground_points=replace(g, role=role))


def extreme(count: int) -> Callable[[np.ndarray], np.ndarray]:
    """The points nearest to so many corners."""

    def keep(xyz: np.ndarray) -> np.ndarray:
        corners = np.array([[-1, -1], [1, 1], [1, -1], [-1, 1]])[:count]
        centred = xyz[:, :2] - xyz[:, :2].mean(axis=0)
        return np.unique([int(np.argmax(centred @ c)) for c in corners])

    return keep


def everything(xyz: np.ndarray) -> np.ndarray:
    """All of them."""
    return np.arange(len(xyz))


def sigmas(block: Block, free: tuple[str, ...]) -> Block:
    """With some camera parameters free."""
    n, p = len(free), block.camera_parameters
    rows = {
        "camera": np.zeros(n, np.int32),
        "name": np.array(free),
        "value": np.full(n, np.nan),
        "sigma": np.full(n, np.nan),
        "free": np.ones(n, bool),
    }
    return replace(block, camera_parameters=type(p)(**rows))


def antennas(block: Block) -> Block:
    """Observed positions are those of antennas."""
    return replace(block, exterior=replace(block.exterior, refers_to=np.full(len(block.exterior), ANTENNA, np.int32)))


def less_image_points(block: Block, keep: np.ndarray) -> Block:
    """Some image points switched off."""
    points = block.image_points
    return replace(block, image_points=replace(points, active=points.active & keep))
