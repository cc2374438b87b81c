"""Strips beyond their control, and the sample block."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aatri.errors import ConvergenceError
from aatri.geometry.similarity import Similarity
from aatri.orientation.bodies.similarity_ties import moved, similarities_of
from aatri.stages.absolute_orientation.similarity import similarity
from aatri.stages.bundle_adjustment.bundle import bundle
from aatri.stages.image_refinement.systematic import systematic
from aatri.stages.interior_orientation.calibrated import calibrated
from aatri.stages.relative_orientation.dependent import dependent
from aatri.stages.strip_adjustment.conformal import conformal
from aatri.stages.strip_adjustment.polynomial import polynomial
from aatri.stages.strip_formation.scale_transfer import scale_transfer
from tests.stages.chain import Chain, run_chain, simulated
from tests.stages.film_blocks import Told

# What is told where control does not suffice, on a block of two strips that are tied along their whole length.


def block_of(*, positions: bool, control: int = 12) -> Any:
    return simulated(
        4,
        camera={"kind": "digital", "format": (9000.0, 9000.0), "pixel_size_mm": 0.02},
        known={"full": control},
        flight={"strips": 2, "images_per_strip": 6},
        ties={"per_position": 3},
        refraction="none",
        gnss={"observed": positions},
    )


def made(block: Any) -> tuple[Any, Any, Any]:
    points = systematic(block, calibrated(block))
    strips = scale_transfer(block, dependent(block, points))
    return points, strips, similarity(block, strips, points)


def test_points_beyond_all_control_are_told_though_ties_go_on() -> None:
    block = block_of(positions=False)
    X = block.ground_points.xyz_m[:, 0]
    west = replace(block, ground_points=block.ground_points.take(np.median(X) > X))
    for given, expected in ((west, True), (block, False)):
        points, strips, absolute = made(given)
        log = Told()
        polynomial(given, points, strips, absolute, context=log)
        told = [text for text in log.warnings if "beyond all control of the block" in text]
        assert bool(told) is expected
    truth = {str(block.points.id[k]): x for k, x in zip(block.true_points.point, block.true_points.xyz_m[:, 0])}
    points, strips, absolute = made(west)
    polynomial(west, points, strips, absolute, context=(log := Told()))
    named = [name for name, x in truth.items() if any("beyond all control" in t and name in t for t in log.warnings)]
    easternmost = west.ground_points.xyz_m[:, 0].max()
    assert named
    assert min(truth[name] for name in named) > easternmost


@pytest.mark.slow
def test_left_handed_control_beside_observed_positions_is_an_error_that_says_what_to_look_at() -> None:
    block = block_of(positions=True, control=8)
    g = block.ground_points
    mirrored = replace(block, ground_points=replace(g, xyz_m=g.xyz_m[:, [1, 0, 2]]))
    with pytest.raises(ConvergenceError) as caught:
        made(mirrored)
    assert "control" in caught.value.what
    assert "axes" in caught.value.remedy


def test_a_scale_that_runs_away_is_an_error_that_says_what_to_look_at() -> None:
    one = similarities_of([Similarity(np.zeros(3), 1.0, np.eye(3))])
    step = np.zeros((1, 7))
    step[0, 6] = 800.0  # exp overflows
    with pytest.raises(ConvergenceError) as caught:
        moved(one, step)
    assert "contradicts itself" in caught.value.what
    assert "left-handed" in caught.value.remedy


# The block by which the lecture notes count: 3 strips of 5 images, points at the standard positions only.


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
