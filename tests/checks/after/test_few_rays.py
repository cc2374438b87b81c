"""The note on points whose wrong ray nothing could tell apart, against a count of the table of image points."""

import numpy as np

from aatri.artifacts.solution import Solution
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.stages.chain import run_chain, simulated
from tests.stages.film_blocks import Told


def test_points_of_two_and_three_rays_are_counted() -> None:
    chain = run_chain(simulated(3, preset="uav", flight={"strips": 2, "images_per_strip": 4}, known={"full": 6}))
    told = Told()
    solution = bundle(chain.block, chain.refined, chain.strip_block, options=BundleOptions(), context=told)
    assert isinstance(solution, Solution)
    m = chain.refined.measurements
    assert len(solution.suspects) == 0
    rays = np.bincount(m.point[m.active], minlength=len(chain.block.points))
    rays[chain.block.ground_points.point[(chain.block.ground_points.role == 1).any(axis=1)]] = 0
    (line,) = [line for line in told.lines if "have two rays" in line]
    assert f" {int((rays == 2).sum())} have two rays" in line
    assert f" {int((rays == 3).sum())} have three" in line
