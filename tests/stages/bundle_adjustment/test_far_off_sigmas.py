"""Standard deviations of image points that are 10, 30 or 100 times too small or too large: the same result."""

from dataclasses import replace

import numpy as np
import pytest

from aatri.stages.initial_orientation.graph import graph
from tests.stages.chain import run_chain, simulated

BLOCKS = {
    "film": {"preset": "rc30", "flight": {"strips": 2, "images_per_strip": 4, "cross_strips": 0}},
    "digital": {"preset": "uav", "flight": {"strips": 2, "images_per_strip": 4, "cross_strips": 0}},
}
FACTORS = [0.01, 1 / 30, 0.1, 10.0, 30.0, 100.0]


def flown(kind: str, control: int = 4, factor: float = 1.0):
    block = simulated(3, **BLOCKS[kind], ties={"new_points": 120}, known={"full": control})
    m = block.image_points
    return replace(block, image_points=replace(m, sigma_mm=factor * m.sigma_mm))


@pytest.mark.slow
@pytest.mark.parametrize("control", [4, 10])
@pytest.mark.parametrize("kind", list(BLOCKS))
@pytest.mark.parametrize("factor", FACTORS)
def test_the_result_is_that_of_the_right_ones(kind: str, control: int, factor: float) -> None:
    right, stated = run_chain(flown(kind, control)).bundle, run_chain(flown(kind, control, factor)).bundle
    sigma_m = np.sqrt(np.einsum("nii->ni", right.points.covariance_m2))
    off_m = np.abs(stated.points.xyz_m - right.points.xyz_m)
    assert np.nanmax(off_m / sigma_m) < 0.5
    assert not stated.suspects.staying_out.any()
    assert stated.sigma0 * factor == pytest.approx(right.sigma0, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("factor", [0.01, 100.0])
def test_images_without_order_are_oriented_too(factor: float) -> None:
    block = flown("digital", 4, factor)
    refined = run_chain(block).refined
    solution = graph(block, refined, rng=np.random.default_rng(1))
    assert solution.images.oriented.all()
    true = block.true_points
    off_m = solution.points.xyz_m[true.point] - true.xyz_m
    assert np.sqrt(np.nanmean(off_m**2, axis=0)).max() < 0.5
