"""Datum by positions that drift or are given in part, and by attitudes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.errors import GeometryError
from aatri.stages.absolute_orientation.similarity import similarity
from aatri.stages.initial_orientation.graph import graph
from aatri.stages.interior_orientation.affine import affine
from aatri.stages.interior_orientation.calibrated import calibrated
from aatri.stages.relative_orientation.dependent import dependent
from aatri.stages.strip_adjustment.polynomial import polynomial
from aatri.stages.strip_formation.scale_transfer import scale_transfer
from tests.small_blocks import adjusted_by, flown
from tests.stages.bundle_adjustment.test_given_in_part import LARGE_M, adjusted, cells, exterior
from tests.stages.chain import simulated
from tests.stages.film_blocks import Told
from tests.stages.hand_block import Hand, ground_rows, hand, read

# Heights, or plan alone, of observed positions take part in every stage that brings free strips to the ground.


def absolute(block: Block, image_points: ImagePoints) -> Solution:
    models = dependent(block, image_points)
    return similarity(block, scale_transfer(block, models), image_points)


def initial(block: Block, image_points: ImagePoints) -> Solution:
    return graph(block, image_points, rng=np.random.default_rng(1))


@pytest.fixture(scope="module")
def of() -> Hand:
    return hand()


@pytest.mark.slow(after=1)
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


@pytest.mark.slow
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


# Positions whose strips share a shift of metres: control alone places the block where it can, before the bundle.

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


@pytest.mark.slow
def test_strips_are_placed_by_control(block: Block) -> None:
    models = dependent(block, points := calibrated(block))
    _assert_placed_by_control(block, similarity(block, scale_transfer(block, models), points))


@pytest.mark.slow
def test_a_graph_is_placed_by_control(block: Block) -> None:
    _assert_placed_by_control(block, graph(block, calibrated(block), rng=np.random.default_rng(1)))


# Attitudes take part in the datum of strips where control and positions leave something open.

MAP = {"earth": "geodetic", "false_origin_m": (446000.0, 4505000.0)}


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("earth", [{}, MAP])
@pytest.mark.parametrize(("control", "positions"), [(2, 0), (1, 1), (0, 2)])
def test_a_line_of_control_and_attitudes_is_a_datum(control: int, positions: int, earth: dict[str, Any]) -> None:
    block = simulated(
        3,
        flight={"strips": 2, "images_per_strip": 5},
        known={"full": control},
        **earth,
        gnss={"observed": True},
        imu={"observed": True},
    )
    use = block.exterior.position_use.copy()
    use[positions:] = 0
    block = replace(block, exterior=replace(block.exterior, position_use=use))
    points = affine(block)
    strips = scale_transfer(block, dependent(block, points))
    told = Told()
    absolute = similarity(block, strips, points, context=told)
    assert any("attitudes of 10 images take part, as control and positions do not place it" in x for x in told.lines)
    assert block.true_images is not None
    found = polynomial(block, points, strips, absolute)
    for solution in (absolute, found):
        off = np.sqrt(((solution.images.position_m - block.true_images.position_m) ** 2).mean(axis=0))
        assert (off < 1.0).all(), off
    without = replace(block.exterior, angle_use=np.zeros(len(use), dtype=np.int32))
    with pytest.raises(GeometryError, match="not determined"):
        similarity(replace(block, exterior=without), strips, points)


@pytest.mark.parametrize("stage", [absolute, initial])
def test_attitudes_tell_that_the_control_point_of_a_strip_with_positions_is_wrong(stage: Any) -> None:
    """Positions on a line hardly hold a turn about it, which the wrong point would decide."""
    flight = {"strips": 1, "images_per_strip": 3, "position_sigma_m": (5.0, 15.0, 15.0)}
    block = simulated(5, flight=flight, known={"full": 1}, gnss={"observed": True}, imu={"observed": True})
    wrong_m = block.ground_points.xyz_m + np.array([300.0, -200.0, 40.0])
    block = replace(block, ground_points=replace(block.ground_points, xyz_m=wrong_m))
    solution = stage(block, affine(block))
    assert block.true_images is not None
    off = solution.images.position_m - block.true_images.position_m
    assert np.abs(off).max() < 1.0
    assert solution.suspects.kind.tolist() == ["control"]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 3])
def test_one_position_of_four_hundreds_of_metres_off_is_rejected_and_bends_no_strip(tmp_path: Path, seed: int) -> None:
    small = flown(1, 7, seed=seed)
    small.observed = dict.fromkeys(["101", "102", "104", "107"], "XYZ")
    small.position_m["107"] = small.position_m["107"] + np.array([300.0, 0.0, 0.0])
    s = adjusted_by("chain", small.write(tmp_path / "block")).initial.suspects
    assert s.image[(s.kind == "position") & s.staying_out].tolist() == ["107"]
    assert not ((s.kind == "control") & s.staying_out).any()
