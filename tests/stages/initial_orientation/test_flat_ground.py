"""Flat ground, few points, no attitudes: what cannot be told apart is left out, never set on the wrong side."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.artifacts.block import Block
from tests.stages.initial_orientation.unordered import initial_of, simulated

FLAT = {
    "camera": {
        "kind": "digital",
        "principal_distance_mm": 9.0,
        "format": (4000.0, 3000.0),
        "pixel_size_mm": 0.0027,
        "margin_mm": 0.1,
    },
    "flight": {
        "strips": 2,
        "images_per_strip": 6,
        "forward_overlap": 65.0,
        "side_overlap": 35.0,
        "scale_number": 1500.0,
    },
    "terrain": {"relief_m": 0.0},
    "ties": {"per_position": 3},
    "known": {"full": 5},
    "gnss": {"observed": True},
    "refraction": "none",
    "earth": "flat",
    "noise": {"image_um": 5.0},
}


def check(block: Block) -> None:
    """Oriented images stand where they were taken, and no position is blamed."""
    found = initial_of(block)
    assert block.true_images is not None
    off_m = np.linalg.norm(found.images.position_m - block.true_images.position_m, axis=1)
    assert np.nanmax(off_m) < 0.4
    assert not np.isin(found.suspects.kind, ["position", "control"]).any()


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("seed", [3, 4, 6, 7])
def test_images_stand_on_the_right_side_of_a_plane(seed: int) -> None:
    check(simulated(seed, **FLAT))


def test_attitudes_decide() -> None:
    block = simulated(4, **FLAT, imu={"observed": True, "boresight": "known", "boresight_deg": (0.1, -0.1, 0.2)})
    check(block)
