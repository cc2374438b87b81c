"""What a stage inherits of the rejections of earlier ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.adapters.solution import suspect_rows
from aatri.adapters.suspects import inherited
from aatri.observations.control import control_of
from tests.stages.chain import run_chain, simulated


@pytest.mark.slow
def test_some_positions_that_are_wrong_stay_out_though_the_strip_block_adjusts_none() -> None:
    """It has no residuals of positions, in use or not: the two that the absolute orientation rejects are not all."""
    flight = {"strips": 2, "images_per_strip": 5}
    gross_errors = {"positions": 2, "size_sigmas": [100, 200]}
    ties = {"new_points": 150}
    chain = run_chain(simulated(3, preset="rc30", flight=flight, ties=ties, gross_errors=gross_errors))
    initial = chain.strip_block
    assert not len(initial.residuals.of_kind("position"))
    suspects, _ = inherited(chain.block, initial)
    assert suspects.verdict[suspects.kind == "position"].tolist() == ["rejected", "rejected"]


@pytest.mark.slow(after=1)
def test_control_of_which_all_is_out_is_tested_as_a_group_and_nothing_where_none_is_placed() -> None:
    flight = {"strips": 2, "images_per_strip": 5}
    chain = run_chain(simulated(3, preset="rc30", flight=flight, ties={"new_points": 150}))
    row = control_of(chain.block).row
    names = chain.block.points.id[chain.block.ground_points.point[row]]
    out = suspect_rows("absolute_orientation", "control", row=row, image=np.full(len(row), ""), point=names)
    initial = replace(chain.strip_block, suspects=out)
    assert (inherited(chain.block, initial)[0].verdict == "readmitted").all()
    points = replace(initial.points, xyz_m=np.full_like(initial.points.xyz_m, np.nan))
    assert (inherited(chain.block, replace(initial, points=points))[0].verdict == "rejected").all()
