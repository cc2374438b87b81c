"""Blocks that leave nothing open."""

from __future__ import annotations

from typing import Any

import numpy as np

from aatri.artifacts.block import Block
from aatri.stages.bundle_adjustment.bundle import BundleOptions
from tests.campaigns import defective_images as images
from tests.campaigns.block_changes import digital, sigmas


def good_block(seed: int) -> tuple[Block, BundleOptions]:
    """A block that leaves nothing open, of ten types: film-size, narrow, with positions, attitudes, cross strips ..."""
    rng = np.random.default_rng(seed)
    flight = {"strips": int(rng.integers(2, 5)), "images_per_strip": int(rng.integers(4, 8)), "cross_strips": seed % 2}
    control = {"full": int(rng.integers(9, 20))}
    shifts: list[dict[str, Any]] = [{}, {"per": "block"}, {}, {"drift": "shift", "per": "strip"}]
    if seed % 10 < 4:
        return digital(seed, gnss=bool(seed % 2), flight=flight, known=control), BundleOptions(
            positions=shifts[seed % 4]
        )
    if seed % 10 < 6:  # a camera calibrated on the job, over relief, with positions
        block = digital(seed, gnss=True, flight=flight, known=control, terrain={"relief_m": 60.0})
        return sigmas(block, ("principal_distance", "principal_point.x", "principal_point.y")), BundleOptions()
    more: dict[str, Any] = {
        "flight": flight | {"tilt_sigma_deg": 1.0, "tilt_max_deg": 3.0, "kappa_sigma_deg": 2.0},
        "known": control,
        "terrain": {"relief_m": 40.0},
    }
    if seed % 10 == 6:  # attitudes with a free boresight, and positions
        return images.flown(
            seed, gnss={"observed": True}, imu={"observed": True, "boresight": "free"}, **more
        ), BundleOptions()
    if seed % 10 == 7:  # a rig whose mount is free
        more["flight"]["cross_strips"] = 0
        member = {"position_m": (0.1, 0.02, -0.03), "angles_deg": (0.0, 25.0, 1.0), "free": True}
        return images.flown(seed, rig={"oblique": member}, **more), BundleOptions()
    if seed % 10 == 8:  # a narrow angle
        more["camera"] = {"principal_distance_mm": 250.0}
        more["flight"]["scale_number"] = 4000.0
        return images.flown(seed, **more), BundleOptions()
    return images.flown(seed, flight=flight, known={"full": 5}), BundleOptions()  # flat, vertical, five points
