"""Blocks on the ellipsoid, in UTM: simulated, with starting angles; and what pooled figures of them are tested by."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.evaluation.accuracy import evaluate
from aatri.geometry.rotations import angles_from_rotation
from tests.stages.chain import simulated

CAMERA = {
    "kind": "digital",
    "principal_distance_mm": 100.0,
    "format": (20000.0, 13000.0),
    "pixel_size_mm": 0.005,
    "margin_mm": 0.0,
}
OFF = 2e-4
"""Error of the starting angles, rad."""


def made(seed: int, height_m: float, **options: Any) -> Block:
    """A block of digital images in UTM, with starting angles where it has no observed ones."""
    chosen = {
        "camera": CAMERA,
        "refraction": "none",
        "earth": "geodetic",
        "false_origin_m": (500_000.0, 4_505_000.0),
        "flight": {
            "strips": 2,
            "images_per_strip": 5,
            "scale_number": height_m / 0.1,
            "side_overlap": 40.0,
            "position_sigma_m": (0.01 * height_m,) * 3,
        },
        "terrain": {"relief_m": 0.02 * height_m, "wavelength_m": height_m},
        "ties": {"per_position": 2},
        "known": {"full": 4, "check_full": 4},
        "noise": {"image_um": 2.0, "control_m": (0.01, 0.01, 0.01), "gnss_m": (0.02, 0.02, 0.03)},
    } | options
    block = simulated(seed, **chosen)
    assert block.true_images is not None
    if block.exterior.angle_use.any():
        return block
    angles = angles_from_rotation(block.true_images.ground_from_image[block.exterior.image])
    angles = angles + OFF * np.random.default_rng(seed).standard_normal(angles.shape)
    return replace(block, exterior=replace(block.exterior, angles_rad=angles))


def figures(block: Block, solution: Solution) -> dict[str, float]:
    found = evaluate(block, solution).figures
    return dict(zip(found.name.tolist(), found.value.tolist()))


def student(values: np.ndarray, expected: float) -> float:
    """Mean of independent blocks less what is expected, over its standard error."""
    return float((values.mean() - expected) / values.std(ddof=1) * np.sqrt(len(values)))
