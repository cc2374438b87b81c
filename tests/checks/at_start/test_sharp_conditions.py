"""Weighted relative control beside image points: what is too sharp to be weighed with them is told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aatri.artifacts.block_tables import RelativeControl
from aatri.checks.after.of_stage import findings_of
from aatri.checks.at_start.sharp_conditions import sharp_conditions
from tests.made_solutions import made_block, made_solution
from tests.stages.chain import simulated


def test_conditions_far_sharper_than_image_points_on_the_ground_are_told() -> None:
    """From 100 m with c 50 mm image points of 5 um are 10 mm on the ground: 0.1 um is 100,000 times as sharp."""
    block = simulated(3, preset="uav", flight={"strips": 2, "images_per_strip": 3})
    m = block.image_points
    cameras = replace(block.cameras, principal_distance_mm=np.full(len(block.cameras), 50.0))
    conditions = RelativeControl.of(
        type=["line", "line", "line", "angle"], value=[np.nan] * 4, sigma=[1e-7, 1e-6, 0.0, 1e-9], axis=[""] * 4
    )
    block = replace(
        block,
        cameras=cameras,
        image_points=replace(m, sigma_mm=np.full((len(m), 2), 0.005)),
        relative_control=conditions,
    )
    position_m, xyz_m = np.zeros((len(block.images), 3)), np.tile([0.0, 60.0, 80.0], (len(block.points), 1))
    (finding,) = sharp_conditions(block, position_m, xyz_m)
    assert finding.level == "warning"
    assert finding.sentence.startswith("line: a standard deviation of 1e-07 m is more than 20,000 times as sharp")
    assert "exact: true" in finding.remedy


def test_every_stage_that_takes_such_conditions_tells_them() -> None:
    conditions = RelativeControl.of(type=["line", "line"], value=[np.nan] * 2, sigma=[1e-9, 1.0], axis=[""] * 2)
    block = replace(made_block(), relative_control=conditions)
    causes = [finding.cause for finding in findings_of(block, made_solution(block), "strip_adjustment")]
    assert causes.count("sharp_conditions") == 1
