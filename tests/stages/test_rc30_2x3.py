"""Six real RC-30 photographs through every stage, against an independent adjustment (README of the data set)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.block import Block
from aatri.codes import CONTROL
from aatri.stages.accuracy.evaluation import evaluation
from aatri.stages.bundle_adjustment.bundle import bundle
from tests.stages.chain import Chain, from_refined, run_rc30_2x3
from tests.stages.film_blocks import Told


@pytest.fixture(scope="module")
def chain(shared_data: Path) -> Chain:
    return run_rc30_2x3(shared_data)


def test_counts_and_sigma0_are_the_published_ones(chain: Chain) -> None:
    metrics = chain.bundle.metrics()
    assert metrics["images"] == 6
    assert metrics["points"] == 22
    assert metrics["image_points"] == 63
    assert metrics["redundancy"] == 36
    assert metrics["sigma0_um"] == pytest.approx(10.62, abs=0.005)


@pytest.mark.parametrize(
    ("image", "expected"), [("319", (446257.009, 4504892.77, 395.183)), ("320", (446030.617, 4504892.84, 399.092))]
)
def test_projection_centres_are_the_published_ones(chain: Chain, image: str, expected: tuple[float, ...]) -> None:
    row = chain.block.images.id.tolist().index(image)
    np.testing.assert_allclose(chain.bundle.images.position_m[row], expected, atol=0.0051)


def test_check_points_differ_as_published(chain: Chain) -> None:
    metrics = evaluation(chain.block, chain.bundle).metrics()
    assert metrics["check_points"] == 3
    measured = [metrics[f"check_rmse_{axis}_m"] for axis in "xyz"]
    np.testing.assert_allclose(measured, [0.187, 0.055, 0.171], atol=0.00051)


def test_the_strips_fall_to_the_first_degree(chain: Chain) -> None:
    polynomials = {str(m) for m in chain.strip_block.transformations.model} - {"similarity"}
    assert polynomials == {"polynomial_1"}


def test_all_stages_orient_all_images(chain: Chain) -> None:
    for solution in (chain.absolute, chain.strip_block, chain.bundle):
        assert solution.images.oriented.all()
        assert np.isfinite(solution.points.xyz_m).all()


def _told(chain: Chain, block: Block) -> tuple[str, set[str]]:
    """What the bundle of the whole chain says of the block, and which control it leaves out."""
    made, heard = from_refined(block, chain.interior, chain.refined, chain.options), Told()
    suspects = bundle(block, made.refined, made.absolute, context=heard).suspects
    out = suspects.staying_out & (suspects.kind == "control")
    return "\n".join(heard.warnings), set(suspects.point[out].tolist())


@pytest.mark.slow
def test_heights_of_all_control_in_feet_are_told_and_no_point_goes_for_them(chain: Chain) -> None:
    """Seven points of 0.1 m, 4 m of relief: absolute orientation rejects three of them, one by one."""
    ground = chain.block.ground_points
    xyz = ground.xyz_m * [1.0, 1.0, 1 / 0.3048]
    covariance = np.broadcast_to(0.1**2 * np.eye(3), ground.covariance_m2.shape)
    known = replace(ground, xyz_m=xyz, covariance_m2=covariance, role=np.full_like(ground.role, CONTROL))
    told, out = _told(chain, replace(chain.block, ground_points=known))
    times, sigma = told.split("images with ")[1].split(") times their relief")[0].split(" (+- ")
    assert abs(float(times) - 0.3048) < 3 * float(sigma)
    assert not out


@pytest.mark.slow
@pytest.mark.parametrize("height_m", [7.841 / 0.3048, 0.0])
def test_a_wrong_height_of_four_exact_points_is_no_distortion_of_the_lens(chain: Chain, height_m: float) -> None:
    """Nothing tells which of them is wrong; a radial distortion of 2 mm explains less than any of them."""
    ground, xyz = chain.block.ground_points, chain.block.ground_points.xyz_m.copy()
    xyz[ground.point == chain.block.points.id.tolist().index("831000"), 2] = height_m
    told, _ = _told(chain, replace(chain.block, ground_points=replace(ground, xyz_m=xyz)))
    assert "radial distortion" not in told
    assert "one of these is wrong, and nothing tells which" in told
    assert "831000" in told.split("one of these is wrong, and nothing tells which")[1].split("\n")[0]
