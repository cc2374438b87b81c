"""GNSS positions in another frame than control: the constant is named, and nothing else is taken for one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.artifacts.block import CONTROL, Block
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.initial_orientation.graph import graph
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.stages.film_blocks import Told
from tests.stages.geodetic_blocks import made


def _told(block: Block) -> list[str]:
    heard = Told()
    bundle(block, calibrated(block), options=BundleOptions(max_sigma0=1e9), context=heard)
    return [text for text in heard.warnings if "by a constant" in text]


@pytest.mark.parametrize("dz", [0.5, -30.0])
def test_heights_of_two_surfaces_are_named_with_their_difference(dz: float) -> None:
    block = made(3, 1000.0, known={"full": 5})
    e = block.exterior
    (text,) = _told(replace(block, exterior=replace(e, position_m=e.position_m + np.array([0.0, 0.0, dz]))))
    assert "heights of positions and control count from different surfaces" in text
    value, sigma = text.split("less control ")[1].split(" m;")[0].split(" (+- ")
    assert abs(float(value) - dz) < 4 * float(sigma.rstrip(")"))
    assert float(sigma.rstrip(")")) < 0.1
    assert "undulation" in text


def test_another_datum_is_named_in_all_coordinates() -> None:
    block = made(3, 1000.0, known={"full": 5})
    e = block.exterior
    (text,) = _told(replace(block, exterior=replace(e, position_m=e.position_m + np.array([3.0, -4.0, 1.0]))))
    assert "positions and control differ" in text


@pytest.mark.slow
def test_what_is_no_shift_is_not_taken_for_one() -> None:
    block = made(3, 1000.0, known={"full": 6})
    assert not _told(block)
    g = block.ground_points
    xyz = g.xyz_m.copy()
    xyz[np.flatnonzero((g.role == CONTROL).all(axis=1))[0], 2] += 2.0  # one wrong control point
    assert not _told(replace(block, ground_points=replace(g, xyz_m=xyz)))
    e, wrong = block.exterior, block.exterior.position_m.copy()
    wrong[2] += [0.0, 0.0, 3.0]  # one wrong position
    assert not _told(replace(block, exterior=replace(e, position_m=wrong)))


@pytest.mark.slow
def test_control_that_the_start_leaves_out_as_a_whole_is_tested_as_a_group() -> None:
    block = made(3, 1000.0, known={"full": 3})
    e, points = block.exterior, calibrated(block)
    block = replace(block, exterior=replace(e, position_m=e.position_m + np.array([0.0, 0.0, 100.0])))
    start, heard = graph(block, points, rng=np.random.default_rng(1)), Told()
    assert not start.residuals.active[start.residuals.kind == "control"].any()
    solution = bundle(block, points, start, context=heard)
    assert solution.contradictions == 1
    assert "heights of positions and control count from different surfaces" in " ".join(heard.warnings)
