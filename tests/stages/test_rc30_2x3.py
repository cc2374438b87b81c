"""Six real RC-30 photographs through every stage, against an independent adjustment (README of the data set)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from aatri.stages.accuracy.evaluation import evaluation
from tests.stages.chain import Chain, run_rc30_2x3


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
