"""Blocks of images that leave something open beside their datum: cameras, rigs, attitudes, positions."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from aatri.artifacts.block import CONTROL, NO_ROLE, Block
from aatri.geometry.rotations import angles_from_rotation
from aatri.stages.bundle_adjustment.bundle import BundleOptions
from tests.stages.chain import simulated

PLANNED = {"position_sigma_m": (0.0, 0.0, 0.0), "tilt_sigma_deg": 0.0, "tilt_max_deg": 0.0, "kappa_sigma_deg": 0.0}
FLAT = {"mean_height_m": 0.0, "relief_m": 0.0}
CAMERA = {
    "kind": "digital",
    "principal_distance_mm": 100.0,
    "format": (8000.0, 8000.0),
    "pixel_size_mm": 0.02,
    "margin_mm": 0.0,
}


def flown(seed: int = 3, **more: Any) -> Block:
    """A digital block with angles of the truth to start from, where none are observed."""
    given: dict[str, Any] = {
        "camera": CAMERA,
        "flight": {"strips": 3, "images_per_strip": 5, "scale_number": 10_000.0, **PLANNED},
        "terrain": FLAT,
        "earth": "flat",
        "refraction": "none",
        "known": {"full": 12},
        "gnss": {"observed": False},
        "ties": {"per_position": 3},
    }
    for name, value in more.items():
        given[name] = {**given[name], **value} if isinstance(given.get(name), dict) else value
    block = simulated(seed, **given)
    truth, e = block.true_images, block.exterior
    assert truth is not None
    if e.angle_use.any():
        return block
    R = np.empty((len(block.images), 3, 3))
    R[truth.image] = truth.ground_from_image
    return replace(block, exterior=replace(e, angles_rad=angles_from_rotation(R[e.image], block.rotation)))  # type: ignore[arg-type]


def with_roles(block: Block, role: dict[int, tuple[int, int, int]]) -> Block:
    """The block with other roles of control points, by row among those it has; the others are new points."""
    g = block.ground_points
    rows = np.flatnonzero((g.role == CONTROL).any(axis=1))
    found = np.full_like(g.role, NO_ROLE)
    for k, which in role.items():
        found[rows[k]] = np.where(np.array(which, dtype=bool), CONTROL, NO_ROLE)
    return replace(block, ground_points=replace(g, role=found))


def freed(block: Block, *names: str) -> Block:
    """With some more camera parameters free."""
    n, p = len(names), block.camera_parameters
    rows: dict[str, Any] = {
        "camera": np.zeros(n, np.int32),
        "name": np.array(names),
        "value": np.full(n, np.nan),
        "sigma": np.full(n, np.nan),
        "free": np.ones(n, bool),
    }
    joined = {name: np.concatenate([getattr(p, name), values]) for name, values in rows.items()}
    return replace(block, camera_parameters=type(p)(**joined))


def k1_of_a_vertical_strip() -> tuple[Block, BundleOptions]:
    """One strip, flat and vertical, control across its two ends: k1 bends it, and nothing holds the bend."""
    block = flown(flight={"strips": 1, "images_per_strip": 7}, camera={"distortion": "brown"})
    return freed(corners(block), "k1"), BundleOptions(max_iterations=60)


def corners(block: Block, count: int = 4) -> Block:
    """With control at the corners alone."""
    g = block.ground_points
    rows = np.flatnonzero((g.role == CONTROL).any(axis=1))
    plan = g.xyz_m[rows, :2] - g.xyz_m[rows, :2].mean(axis=0)
    plan = plan / plan.std(axis=0)
    chosen = [int(np.argmax(plan @ np.array(c))) for c in ((-1, -1), (1, 1), (1, -1), (-1, 1))]
    return with_roles(block, dict.fromkeys(chosen[:count], (1, 1, 1)))


def boresight_about_z() -> tuple[Block, BundleOptions]:
    """One point in full, another in X, heights elsewhere, flown one way: azimuth and free boresight turn together."""
    block = flown(flight={"strips": 1, "images_per_strip": 7}, imu={"observed": True, "boresight": "free"})
    xyz = block.ground_points.xyz_m[(block.ground_points.role == CONTROL).any(axis=1)]
    away = np.abs(xyz - xyz[0])
    along = int(np.argmax(away[:, 0] - 3 * away[:, 1]))  # its X holds the scale
    return with_roles(block, dict.fromkeys(range(12), (0, 0, 1)) | {0: (1, 1, 1), along: (1, 0, 1)}), BundleOptions()


def principal_point_and_boresight() -> tuple[Block, BundleOptions]:
    """A narrow angle, positions and attitudes observed, flown one way: a shifted principal point is a boresight."""
    block = flown(
        camera={"principal_distance_mm": 300.0},
        flight={"strips": 1, "images_per_strip": 7},
        gnss={"observed": True},
        imu={"observed": True, "boresight": "free"},
    )
    return freed(corners(block), "principal_point.x", "principal_point.y"), BundleOptions()


def mount_seen_once() -> tuple[Block, BundleOptions]:
    """A free mount in one exposure alone, whose image has two points: pose and mount hold each other."""
    member = {"position_m": (0.1, 0.02, -0.03), "angles_deg": (0.0, 25.0, 1.0), "free": True}
    block = flown(
        flight={"strips": 2, "images_per_strip": 4, "tilt_sigma_deg": 1.0, "tilt_max_deg": 2.0}, rig={"oblique": member}
    )
    oblique = np.flatnonzero(block.images.member == "oblique")
    keep = ~np.isin(block.image_points.image, oblique[1:])
    mine = np.flatnonzero(block.image_points.image == oblique[0])
    keep[mine[2:]] = False
    active = block.images.active.copy()
    active[oblique[1:]] = False
    points = replace(block.image_points, active=block.image_points.active & keep)
    return replace(block, image_points=points, images=replace(block.images, active=active)), BundleOptions()


def drift_of_strips() -> tuple[Block, BundleOptions]:
    """Positions with a drift of each strip, control at the corners, no cross strips."""
    block = flown(
        flight={"strips": 4, "images_per_strip": 8},
        gnss={"observed": True},
        ties={"per_position": 1},
        known={"full": 4},
    )
    return corners(block), BundleOptions(positions={"drift": "linear", "per": "strip"})
