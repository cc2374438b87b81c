"""The block by which the lecture notes count: 3 strips of 5 images, points at the standard positions only."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.stages.bundle_adjustment.bundle import bundle
from aatri.stages.strip_adjustment.conformal import conformal
from tests.stages.chain import Chain, run_chain, simulated
from tests.stages.film_blocks import Told


@pytest.fixture(scope="module")
def sample() -> Chain:
    return run_chain(simulated(preset="sample"))


def test_observations_and_unknowns_of_the_bundle_are_those_of_the_notes(sample: Chain) -> None:
    """(6*6 + 9*9) * 2 = 234 image coordinates, 15*6 + 23*3 + 2*2 = 163 unknowns."""
    found = bundle(sample.block, sample.refined, sample.strip_block).metrics()
    assert (found["observations"], found["unknowns"], found["redundancy"]) == (234, 163, 71)


@pytest.mark.parametrize(
    ("method", "counts"),
    [
        ("polynomial", "62 equations of control and ties, 45 coefficients"),
        ("conformal", "62 equations of control and ties, 33 coefficients"),
    ],
)
def test_equations_and_coefficients_of_the_strip_block_are_those_of_the_notes(
    sample: Chain, method: str, counts: str
) -> None:
    from aatri.stages.strip_adjustment.polynomial import polynomial

    told = Told()
    adjust = {"polynomial": polynomial, "conformal": conformal}[method]
    found = adjust(sample.block, sample.refined, sample.strips, sample.absolute, context=told)
    assert any(counts in text for text in told.lines)
    assert found.metrics()["redundancy"] == {"polynomial": 17, "conformal": 29}[method]


def test_strips_tied_by_one_row_of_points_are_oriented_by_their_own_control(sample: Chain) -> None:
    """Five points in a row, off their line by the relief: joined rigidly, the strips were 27 m off the control."""
    truth = sample.block.true_images
    assert truth is not None
    off = np.linalg.norm(sample.absolute.images.position_m - truth.position_m, axis=1)
    assert off.max() < 5.0
    off = np.linalg.norm(sample.bundle.images.position_m - truth.position_m, axis=1)
    assert off.max() < 2.0
