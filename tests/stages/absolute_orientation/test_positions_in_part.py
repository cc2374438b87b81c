"""Heights, or plan alone, of observed positions take part in every stage that brings free strips to the ground."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.stages.absolute_orientation.similarity import similarity
from aatri.stages.initial_orientation.graph import graph
from aatri.stages.relative_orientation.dependent import dependent
from aatri.stages.strip_formation.scale_transfer import scale_transfer
from tests.stages.bundle_adjustment.test_given_in_part import LARGE_M, adjusted, cells, exterior
from tests.stages.hand_block import Hand, ground_rows, hand, read


def absolute(block: Block, image_points: ImagePoints) -> Solution:
    models = dependent(block, image_points)
    return similarity(block, scale_transfer(block, models), image_points)


def initial(block: Block, image_points: ImagePoints) -> Solution:
    return graph(block, image_points, rng=np.random.default_rng(1))


@pytest.fixture(scope="module")
def of() -> Hand:
    return hand()


@pytest.mark.parametrize("stage", [absolute, initial])
@pytest.mark.parametrize("given", ["Z", "XY"])
def test_positions_in_part_are_those_whose_others_say_nothing(
    of: Hand, given: str, stage: object, tmp_path: Path
) -> None:
    tilted = np.outer(np.arange(6) % 3, [0.025, -0.0125, 0.05])
    found = []
    for sigma in (None, LARGE_M, 0.03):
        rows = []
        for k in range(6):
            row = cells(of, k, tilted[k]) | {f"s{c}": 0.03 if c in given else sigma for c in "XYZ"}
            rows.append({name: v for name, v in row.items() if sigma is not None or name.removeprefix("s") in given})
        block, points = read(tmp_path / str(sigma), of, ground=ground_rows(of, [0, 5, 24, 29]), exterior=exterior(rows))
        found.append(stage(block, points).images.position_m)  # type: ignore[operator]
    np.testing.assert_allclose(found[0], found[1], atol=1e-4)
    assert np.abs(found[0] - of.position_m).max() > 1e-3
    assert np.abs(found[0] - found[2]).max() > 1e-3


@pytest.mark.parametrize("stage", [absolute, initial])
def test_heights_of_a_statoscope_level_a_block_of_plan_control(of: Hand, stage: object, tmp_path: Path) -> None:
    """Control in plan of four points, one height, and the heights of the images: what a photo block once had."""
    rows = [{"Z": of.position_m[k, 2], "sZ": 0.05} for k in range(6)]
    plan = "\n".join(line.rsplit(",", 1)[0] + "," for line in ground_rows(of, [0, 5, 24, 29]).splitlines()[1:])
    ground = f"point,X,Y,Z\n{plan}\n" + ground_rows(of, [14]).splitlines()[1] + "\n"
    block, points = read(tmp_path, of, ground=ground, exterior=exterior(rows))
    found = stage(block, points)  # type: ignore[operator]
    np.testing.assert_allclose(found.images.position_m, of.position_m, atol=1e-3)


def test_exact_positions_orient_a_block_without_control(of: Hand, tmp_path: Path) -> None:
    rows = [cells(of, k) | dict.fromkeys(("sX", "sY", "sZ"), 0) for k in range(6)]
    block, points = read(tmp_path, of, exterior=exterior(rows))
    np.testing.assert_allclose(absolute(block, points).images.position_m, of.position_m, atol=1e-3)
    np.testing.assert_allclose(adjusted(tmp_path, of, rows).images.position_m, of.position_m, atol=1e-9)
