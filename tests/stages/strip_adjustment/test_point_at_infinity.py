"""A point of parallel rays in a strip: nothing places it, and it is no reason to give the strip up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.stages.absolute_orientation.similarity import similarity
from aatri.stages.strip_adjustment.polynomial import polynomial
from tests.campaigns.legal.cell import cell_of
from tests.campaigns.legal.judged import end_of
from tests.made_strips import Heard, MadeBlock

CELL = (
    "control=two positions=none attitudes=all tilt=40 camera=film parameters=removable sigmas=fifth wrong=parallel "
    "seed=8868 sigmas_of=all noise=normal"
)
"""Its rays meet at 120,000 bases, known to six times that along the ray and to three bases across."""


@pytest.mark.slow
def test_a_point_at_infinity_costs_no_strip() -> None:
    assert end_of(cell_of(CELL), "chain").outcome == "good"


def test_a_point_at_infinity_is_named() -> None:
    made, heard = MadeBlock(1, 6), Heard()
    made.control(made.corners(), sigma_m=0.02)
    block, points, strips = made.block(), made.image_points(), made.strips()
    lost = int(np.setdiff1d(strips.strip_points.point, made.corners())[0])
    table = strips.strip_points
    times = np.where(table.point == lost, 1e10, 1.0)[:, None, None]
    strips = replace(strips, strip_points=replace(table, covariance=table.covariance * times))
    solution = polynomial(block, points, strips, similarity(block, strips, points), context=heard)
    (line,) = [text for text in heard.warnings if "infinity" in text]
    assert line.endswith(f": {block.points.id[lost]}")
    assert np.flatnonzero(np.isnan(solution.points.xyz_m).any(axis=1)).tolist() == [lost]
