"""Positions whose strips share a shift of metres: control alone places the block where it can, before the bundle."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.stages.absolute_orientation.similarity import similarity
from aatri.stages.initial_orientation.graph import graph
from aatri.stages.interior_orientation.calibrated import calibrated
from aatri.stages.relative_orientation.dependent import dependent
from aatri.stages.strip_formation.scale_transfer import scale_transfer
from tests.stages.chain import simulated

SHIFT_M = 2.0


@pytest.fixture(scope="module")
def block() -> Block:
    return simulated(
        5,
        camera={
            "kind": "digital",
            "principal_distance_mm": 35.0,
            "format": (4000.0, 3000.0),
            "pixel_size_mm": 0.01,
            "margin_mm": 0.1,
        },
        flight={
            "strips": 3,
            "images_per_strip": 4,
            "forward_overlap": 65.0,
            "side_overlap": 40.0,
            "scale_number": 1500.0,
        },
        ties={"per_position": 8},
        known={"full": 5},
        noise={"image_um": 2.0},
        gnss={"shift_m": SHIFT_M},
        refraction="none",
    )


def _assert_placed_by_control(block: Block, solution: Solution) -> None:
    assert block.true_images is not None
    assert (block.exterior.drift_group != "").all()
    off = np.linalg.norm(solution.images.position_m - block.true_images.position_m, axis=1)
    assert off.max() < 0.3 * SHIFT_M
    assert "position" not in solution.suspects.kind.tolist()


def test_strips_are_placed_by_control(block: Block) -> None:
    models = dependent(block, points := calibrated(block))
    _assert_placed_by_control(block, similarity(block, scale_transfer(block, models), points))


def test_a_graph_is_placed_by_control(block: Block) -> None:
    _assert_placed_by_control(block, graph(block, calibrated(block), rng=np.random.default_rng(1)))
