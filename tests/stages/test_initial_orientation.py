"""Images of any arrangement, oriented without strips, order or start values."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.formats.tables.reader import read_block
from aatri.stages.accuracy.evaluation import evaluation
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.image_refinement.systematic import SystematicOptions, systematic
from aatri.stages.initial_orientation.graph import GraphOptions, graph
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.made_uav_3strips import block_folder


def measured(block: Block) -> ImagePoints:
    return systematic(block, calibrated(block), options=SystematicOptions(refraction=False))


@pytest.mark.slow
def test_three_oblique_strips_are_oriented_without_strips_order_or_start(shared_data: Path, tmp_path: Path) -> None:
    block = read_block(block_folder(shared_data / "uav_3strips", tmp_path / "block"))
    assert not len(block.strips)
    points = measured(block)
    initial = graph(block, points, rng=np.random.default_rng(1))
    assert initial.images.oriented.all()
    done = bundle(block, points, initial, options=BundleOptions(blunders={"method": "robust_snooping"}))
    found = evaluation(block, done).metrics()
    # Nothing is published of this block: the check points are known to 3 cm.
    assert found["check_points"] == 11
    assert max(found[f"check_rmse_{axis}_m"] or 1.0 for axis in "xyz") < 0.06


@pytest.mark.slow
def test_without_control_the_datum_is_free_and_the_first_base_is_one(shared_data: Path, tmp_path: Path) -> None:
    block = read_block(block_folder(shared_data / "uav_3strips", tmp_path / "block"))
    block = replace(block, ground_points=block.ground_points.take(np.zeros(0, dtype=np.intp)))
    initial = graph(block, measured(block), options=GraphOptions(pairs_per_image=6), rng=np.random.default_rng(1))
    assert initial.datum is not None
    centre = initial.images.position_m
    assert np.linalg.norm(centre[1] - centre[0]) == pytest.approx(1.0, rel=1e-12)
    assert initial.images.oriented.all()
