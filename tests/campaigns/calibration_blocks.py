"""Twelve types of small blocks with normal errors of just the standard deviations they give, for `calibration`.

Each block comes from a seed of its own: other stations, terrain, points and errors. They are adjusted from positions of
the flight plan, off by some metres (or observed ones), and attitudes off by a degree (1 sigma).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.stages.interior_orientation.affine import affine
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.campaigns.variance_components import SIGMA, with_distances
from tests.stages.chain import simulated

DIGITAL = {"kind": "digital", "distortion": "none", "format": (20000.0, 20000.0), "pixel_size_mm": 0.0115}
"""A camera of 230 mm x 230 mm in pixels."""

PLANNED = {"observed": False, "approximate_positions": True}
LENS = {"k1": 1e-8, "k2": -4e-13, "p1": 1e-7, "p2": -6e-8, "b1": 1e-4, "b2": -5e-5}
SMALL = {
    "camera": DIGITAL,
    "flight": {"strips": 2, "images_per_strip": 5, "cross_strips": 0},
    "ties": {"per_position": 2, "new_points": 60},
    "known": {"full": 8, "check_full": 0},
}


@dataclass(frozen=True)
class Type:
    """A type of block: what is simulated, what is done to it, and with which options the bundle adjusts it."""

    simulated: Mapping[str, Any]
    options: Mapping[str, Any]
    also: Callable[[Block, np.random.Generator], Block] | None = None

    def made(self, seed: int) -> tuple[Block, ImagePoints]:
        """The block of a seed and its photo coordinates."""
        rng = np.random.default_rng([seed, 1])
        block = _started(_flown(seed, self.simulated), rng)
        if self.also is not None:
            block = self.also(block, rng)
        return block, affine(block) if (block.cameras.kind == "film").any() else calibrated(block)


def _flown(seed: int, given: Mapping[str, Any]) -> Block:
    if given.get("preset"):
        return simulated(seed, **given)
    parts = {name: {**value, **given.get(name, {})} for name, value in SMALL.items()}
    return simulated(seed, preset="rc30", earth="flat", refraction="none", **{**given, **parts})


def _started(block: Block, rng: np.random.Generator) -> Block:
    """With attitudes to start from, where none are observed."""
    if np.isfinite(block.exterior.angles_rad).any():
        return block
    truth = block.true_images
    assert truth is not None
    off = Rotation.from_rotvec(np.radians(rng.normal(size=(len(truth), 3))))
    angles = (Rotation.from_matrix(truth.ground_from_image[block.exterior.image]) * off).as_euler("XYZ")
    return replace(block, exterior=replace(block.exterior, angles_rad=angles))


def _two_cameras(block: Block, rng: np.random.Generator) -> Block:
    """Every other image of a second camera with twice the standard deviation and twice the errors."""
    cameras, points = block.cameras, block.image_points
    twice = {name: np.repeat(getattr(cameras, name), 2, axis=0) for name in cameras.__dataclass_fields__}
    twice["id"] = np.array(["A", "B"])
    camera = (np.arange(len(block.images)) % 2).astype(np.int32)
    second = camera[points.image] == 1
    more = np.sqrt(3.0) * points.sigma_mm / cameras.pixel_size_mm[0] * rng.normal(size=points.xy.shape)
    return replace(
        block,
        cameras=type(cameras)(**twice),
        images=replace(block.images, camera=camera),
        image_points=replace(
            points,
            xy=points.xy + second[:, None] * more,
            sigma_mm=np.where(second[:, None], 2.0, 1.0) * points.sigma_mm,
        ),
    )


def _distances(block: Block, rng: np.random.Generator) -> Block:
    made = with_distances(block, 40)
    assert made.geodetic is not None
    value = made.geodetic.value + SIGMA["distance_m"] * rng.normal(size=len(made.geodetic))
    return replace(made, geodetic=replace(made.geodetic, value=value))


TYPES: dict[str, Type] = {
    "control only": Type({"gnss": PLANNED}, {}),
    "cross strips": Type(
        {"flight": {"cross_strips": 2, "images_per_cross_strip": 3}, "gnss": PLANNED, "known": {"full": 5}}, {}
    ),
    "positions": Type({"known": {"full": 4}}, {}),
    "positions with drift": Type(
        {"flight": {"cross_strips": 2, "images_per_cross_strip": 3}, "gnss": {"shift_m": 0.3, "drift_m_per_s": 0.02}},
        {},
    ),
    "positions and attitudes": Type({"known": {"full": 2}, "imu": {"observed": True}}, {}),
    "distances": Type({"gnss": PLANNED, "known": {"full": 3}}, {}, _distances),
    "two cameras": Type({"known": {"full": 4}}, {}, _two_cameras),
    "self-calibration": Type(
        {
            "camera": {"distortion": "brown", "brown": LENS, "distortion_known": False},
            "ties": {"new_points": 100},
            "flight": {"strips": 3},
        },
        {"self_calibration": {"set": "brown_conrady", "sigma_um": None}},
    ),
    "film, fiducials of 5 um": Type(
        {"camera": {"kind": "film", "format": (230.0, 230.0)}, "noise": {"fiducial_um": 5.0}},
        {"interior_unknowns": True},
    ),
    "free datum": Type({"gnss": PLANNED, "known": {"full": 0}, "ties": {"new_points": 70}}, {"datum": "free"}),
    "single model": Type(
        {
            "flight": {"strips": 1, "images_per_strip": 2},
            "gnss": PLANNED,
            "known": {"full": 6},
            "ties": {"per_position": 6},
        },
        {},
    ),
    "oblique, pixels": Type(
        {
            "preset": "oblique",
            "flight": {"strips": 1, "images_per_strip": 3},
            "ties": {"new_points": 90},
            "known": {"full": 6, "check_full": 0},
            "camera": {"distortion": "none"},
            "gnss": PLANNED,
        },
        {},
    ),
}
