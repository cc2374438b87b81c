"""What is told where control does not suffice, on a block of two strips that are tied along their whole length."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aatri.errors import ConvergenceError
from aatri.geometry.similarity import Similarity
from aatri.orientation.bodies.similarity_ties import moved, similarities_of
from aatri.stages.absolute_orientation.similarity import similarity
from aatri.stages.image_refinement.systematic import systematic
from aatri.stages.interior_orientation.calibrated import calibrated
from aatri.stages.relative_orientation.dependent import dependent
from aatri.stages.strip_adjustment.polynomial import polynomial
from aatri.stages.strip_formation.scale_transfer import scale_transfer
from tests.stages.chain import simulated
from tests.stages.film_blocks import Told


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
