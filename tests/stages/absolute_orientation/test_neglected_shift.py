"""Positions whose strips have shifts of their own, and no or one control point: what is neglected blames nobody."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from aatri.errors import GeometryError
from aatri.stages.absolute_orientation.similarity import similarity
from aatri.stages.bundle_adjustment.bundle import bundle
from aatri.stages.image_refinement.systematic import systematic
from aatri.stages.initial_orientation.graph import graph
from aatri.stages.interior_orientation.affine import affine
from aatri.stages.relative_orientation.dependent import dependent
from aatri.stages.strip_adjustment.polynomial import polynomial
from aatri.stages.strip_formation.scale_transfer import scale_transfer
from tests.stages.chain import simulated
from tests.stages.film_blocks import Told

SHIFTED = {
    "camera": {"kind": "film", "fiducials": 4},
    "flight": {
        "strips": 2,
        "images_per_strip": 5,
        "forward_overlap": 80.0,
        "side_overlap": 60.0,
        "scale_number": 1500.0,
    },
    "terrain": {"relief_m": 20.0},
    "ties": {"per_position": 3},
    "known": {"full": 0},
    "gnss": {"observed": True, "shift_m": 12.0},
    "noise": {"image_um": 2.0},
}


def test_the_bundle_says_what_is_open_and_nobody_is_blamed_before() -> None:
    block, told = simulated(3, **SHIFTED), Told()
    points = systematic(block, affine(block))
    strips = scale_transfer(block, dependent(block, points))
    absolute = similarity(block, strips, points, context=told)
    assert any("shift and drift of positions are neglected" in text for text in [*told.lines, *told.warnings])
    rejected = absolute.suspects.kind[absolute.suspects.verdict == "rejected"]
    assert not (rejected == "position").any()
    start = polynomial(block, points, strips, absolute)
    with pytest.raises(GeometryError, match="shift X of drift") as refused:
        bundle(block, points, start)
    assert "shift of its own" in refused.value.remedy


def one_control_point(**flight: int) -> dict[str, Any]:
    return {**SHIFTED, "known": {"full": 1}, "flight": {**SHIFTED["flight"], **flight}}


@pytest.mark.slow
@pytest.mark.parametrize("way", ["chain", "graph"])
def test_the_control_point_that_shifted_positions_outvote_comes_back_where_the_datum_rests_on_it(way: str) -> None:
    block = simulated(3, **one_control_point(cross_strips=1))
    points = systematic(block, affine(block))
    if way == "graph":
        start = graph(block, points, rng=np.random.default_rng(1))
    else:
        strips = scale_transfer(block, dependent(block, points))
        start = polynomial(block, points, strips, similarity(block, strips, points))
    solution = bundle(block, points, start)
    of_control = solution.suspects.verdict[solution.suspects.kind == "control"]
    assert of_control.tolist() == ["readmitted"]
    assert block.true_points is not None
    d = solution.points.xyz_m[block.true_points.point] - block.true_points.xyz_m
    C = solution.points.covariance_m2[block.true_points.point]
    seen = np.isfinite(d).all(axis=1)
    chi_square = np.einsum("ni,ni->n", d[seen], np.linalg.solve(C[seen], d[seen][:, :, None])[:, :, 0])
    assert chi_square.max() < 30  # of three, 1e-6


def test_a_strip_whose_turn_about_itself_one_control_point_holds_keeps_that() -> None:
    block = simulated(1, **one_control_point(strips=1, images_per_strip=8))
    points = systematic(block, affine(block))
    absolute = similarity(block, scale_transfer(block, dependent(block, points)), points)
    assert absolute.images.oriented.all()
    assert not np.isin(absolute.suspects.verdict, ["rejected"]).any()
