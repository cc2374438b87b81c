"""A principal distance that is only known by a share, as EXIF has it: nothing right is taken for wrong."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.artifacts.block import Block, CameraParameters
from aatri.stages.bundle_adjustment.bundle import bundle
from tests.stages.film_blocks import Told
from tests.stages.initial_orientation.unordered import initial_of, measured, simulated

DRONE = {
    "camera": {
        "kind": "digital",
        "principal_distance_mm": 9.0,
        "format": (4000.0, 3000.0),
        "pixel_size_mm": 0.0027,
        "margin_mm": 0.1,
    },
    "flight": {
        "strips": 2,
        "images_per_strip": 5,
        "cross_strips": 1,
        "forward_overlap": 75.0,
        "side_overlap": 60.0,
        "scale_number": 10000.0,
    },
    "terrain": {"relief_m": 10.0},
    "ties": {"per_position": 4},
    "known": {"full": 4},
    "gnss": {"observed": True},
    "refraction": "none",
    "earth": "flat",
    "noise": {"image_um": 1.0},
}


def with_distance_off(block: Block, share: float, *, free: bool = False) -> Block:
    """The principal distance wrong by a share, and open: by 30 %, or without a weight."""
    c_mm = block.cameras.principal_distance_mm * (1.0 + share)
    is_open = CameraParameters(
        camera=np.array([0], dtype=np.int32),
        name=np.array(["principal_distance"]),
        value=np.array([np.nan]),
        sigma=np.array([np.nan if free else 0.3 * c_mm[0]]),
        free=np.array([free]),
    )
    return replace(block, cameras=replace(block.cameras, principal_distance_mm=c_mm), camera_parameters=is_open)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("share", [0.12, -0.12])
@pytest.mark.parametrize("free", [False, True])
def test_positions_and_control_are_not_blamed(share: float, free: bool) -> None:
    true, told = simulated(2, **DRONE), Told()
    block = with_distance_off(true, share, free=free)
    found = initial_of(block, told)
    assert not np.isin(found.suspects.kind, ["position", "control"]).any()
    assert not any("contradict" in text for text in told.warnings)
    done = bundle(block, measured(block), found)
    assert done.cameras.principal_distance_mm[0] == pytest.approx(9.0, rel=2e-3)
    assert not (done.suspects.verdict == "rejected").any()


@pytest.mark.slow
def test_where_the_principal_distance_is_known_the_contradiction_is_told() -> None:
    block, told = simulated(2, **DRONE), Told()
    wrong = replace(
        block, cameras=replace(block.cameras, principal_distance_mm=1.12 * block.cameras.principal_distance_mm)
    )
    initial_of(wrong, told)
    assert any("contradict" in text for text in told.warnings)


@pytest.mark.slow
def test_a_position_far_off_in_plan_is_found_all_the_same() -> None:
    block = with_distance_off(simulated(2, **DRONE), 0.12)
    e = block.exterior
    moved = e.position_m.copy()
    moved[4, 0] += 40.0
    found = initial_of(replace(block, exterior=replace(e, position_m=moved)))
    rows = found.suspects.kind == "position"
    assert found.suspects.image[rows].tolist() == [block.images.id[e.image[4]]]
