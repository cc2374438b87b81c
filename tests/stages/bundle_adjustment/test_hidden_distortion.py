"""A lens that a block takes for free of distortion: told by its residuals, with what it does to the heights."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from aatri.artifacts.block import Block
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.stages.chain import Chain, run_chain, simulated
from tests.stages.film_blocks import Told

FREE = {"set": "brown_conrady", "per": {"camera": ["k1"]}, "sigma_um": None}


def _chain(k1: float) -> Chain:
    camera = {"distortion": "brown", "brown": {"k1": k1}}
    block = simulated(
        preset="rc30",
        flight={"strips": 3, "images_per_strip": 6, "cross_strips": 0},
        ties={"new_points": 200},
        known={"full": 8, "check_full": 6},
        camera=camera,
    )
    nothing = np.zeros(0, dtype=np.int64)
    cameras = replace(block.cameras, distortion=np.full(len(block.cameras), "none"))
    return run_chain(replace(block, cameras=cameras, camera_parameters=block.camera_parameters.take(nothing)))


def _told(chain: Chain, **options: object) -> tuple[list[str], Block]:
    heard = Told()
    made = bundle(chain.block, chain.refined, chain.strip_block, options=BundleOptions(**options), context=heard)
    return [text for text in heard.warnings if "radial distortion of" in text], made


@pytest.fixture(scope="module")
def distorted() -> Chain:
    return _chain(5e-9)


@pytest.mark.slow
def test_a_distortion_is_told_with_its_size_as_an_adjustment_finds_it(distorted: Chain) -> None:
    (text,), without = _told(distorted)
    none, carried = _told(distorted, self_calibration=FREE)
    assert not none
    value, sigma = (float(x) for x in re.search(r"distortion of (\S+) um \(\+- (\S+) um\)", text).groups())
    half = 0.5 * distorted.block.cameras.format[0]
    k1 = carried.parameters.name.tolist().index("k1")
    factor = 1e3 * float(np.hypot(*half)) ** 3
    assert value == pytest.approx(factor * carried.parameters.value[k1], rel=0.05)
    assert sigma == pytest.approx(factor * carried.parameters.sigma[k1] * without.sigma0, rel=0.1)
    axis, point, bend = re.search(r"moves (\S) of point (\S+) by (\S+) mm", text).groups()
    row = without.points.id.tolist().index(point)
    moved = np.abs(carried.points.xyz_m - without.points.xyz_m)[row, "XYZ".index(axis)]
    assert float(bend) == pytest.approx(1e3 * moved, rel=0.1)


def test_of_a_lens_without_distortion_nothing_is_told() -> None:
    assert not _told(_chain(0.0))[0]
