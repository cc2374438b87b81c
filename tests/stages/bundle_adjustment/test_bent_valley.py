"""Self-calibration from a principal distance far off: the valley of c and the flying height bends, the steps follow it.

Every image is oriented with the wrong c before, as the stages before the bundle do. The solution does not depend on the
start: it is held against the one from the right c.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.block import Block, CameraParameters
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.image_refinement.systematic import SystematicOptions, systematic
from aatri.stages.initial_orientation.graph import graph
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.made_uav_3strips import block_folder
from tests.reading import read_block
from tests.stages.film_blocks import Told
from tests.stages.initial_orientation.unordered import SMALL_UAV, simulated, without_strips

MOST = 20
"""Iterations that an adjustment may need."""

FREE = ("principal_distance", "principal_point.x", "principal_point.y", "k1", "k2", "k3", "p1", "p2")
FLAT = {**SMALL_UAV, "flight": {"strips": 4, "images_per_strip": 8}, "ties": {"random_per_image": 60.0}}
# as few images as show the valley: each is adjusted for seconds
HOVER = {"preset": "hover", "flight": {"strips": 4}, "ties": {"new_points": 300}}
ORBIT = {"preset": "orbit", "flight": {"images_per_strip": 10}, "ties": {"new_points": 150}}
OBLIQUE = {"preset": "oblique", "flight": {"strips": 2, "images_per_strip": 3}, "ties": {"new_points": 300}}


def uncalibrated(block: Block, c_factor: float, x0_share: float = 0.0) -> Block:
    """The block without calibration: c times a factor, the principal point off by a share of the format, no lens."""
    cameras, n = block.cameras, len(FREE)
    free = CameraParameters(
        camera=np.zeros(n, np.int32),
        name=np.array(FREE),
        sigma=np.full(n, np.nan),
        free=np.ones(n, dtype=bool),
        value=np.array([np.nan, *[0.0] * (n - 1)]),
    )
    wrong = replace(
        cameras,
        principal_distance_mm=c_factor * cameras.principal_distance_mm,
        principal_point_mm=cameras.principal_point_mm + x0_share * cameras.format * cameras.pixel_size_mm,
        distortion=np.array(["brown"]),
    )
    return replace(block, cameras=wrong, camera_parameters=free)


def measured(block: Block) -> ImagePoints:
    off = SystematicOptions(distortion=False, refraction=False, earth_curvature=False)
    return systematic(block, calibrated(block), options=off)


def adjusted(block: Block) -> tuple[Solution, int]:
    """Oriented and adjusted with all parameters free, and the most iterations of an adjustment."""
    points, told = measured(block), Told()
    start = graph(block, points, rng=np.random.default_rng(1))
    done = bundle(block, points, start, options=BundleOptions(blunders="none", max_sigma0=1e3), context=told)
    iterations = [int(line.split()[1].rstrip(":")) for line in told.lines if line.startswith("iteration ")]
    return done, max(iterations)


def without_positions(block: Block) -> Block:
    return replace(block, exterior=block.exterior.take(np.zeros(0, dtype=np.intp)))


def right(block: Block, wrong: list[tuple[float, float]]) -> None:
    """From each wrong principal distance and point the adjustment ends where it does from the right ones."""
    expected, few = adjusted(uncalibrated(block, 1.0))
    assert few <= 5
    for c_factor, x0_share in wrong:
        found, iterations = adjusted(uncalibrated(block, c_factor, x0_share))
        assert iterations <= MOST, (c_factor, x0_share)
        # which rays the stages before leave out depends on the start, hence not to the last digit
        c, sigma = (getattr(expected.parameters, name)[0] for name in ("value", "sigma"))
        assert abs(found.parameters.value[0] - c) < sigma, (c_factor, x0_share)
        assert found.sigma0 == pytest.approx(expected.sigma0, rel=0.02), (c_factor, x0_share)


WRONG = [(0.71, 0.0), (1.29, 0.0), (1.0, 0.05)]


@pytest.mark.slow
def test_of_a_flat_block_without_positions() -> None:
    right(without_positions(without_strips(simulated(**FLAT))), [*WRONG, (0.9, 0.0), (1.1, 0.0)])


@pytest.mark.slow
def test_of_a_flat_block_with_positions() -> None:
    right(without_strips(simulated(**FLAT)), [(1.29, 0.0)])


@pytest.mark.slow
@pytest.mark.parametrize("made", [HOVER, ORBIT, OBLIQUE], ids=["hover", "orbit", "oblique"])
def test_of_other_arrangements(made: dict[str, object]) -> None:
    right(without_strips(simulated(**made)), WRONG)


@pytest.mark.slow
def test_of_three_oblique_strips(shared_data: Path, tmp_path: Path) -> None:
    right(read_block(block_folder(shared_data / "uav_3strips", tmp_path / "block")), WRONG)
