"""Orientations held against points and control: a line per camera, what no flight has, control outside of its
images."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aatri.checks.at_start.orientations import control_outside, few_oriented, turned_over, unlikely_orientations
from aatri.codes import NO_ROLE
from aatri.observations.poses import Poses
from tests.made_solutions import made_block, made_solution

MADE = made_block()
BLOCK = replace(MADE, cameras=replace(MADE.cameras, format=np.array([[600.0, 600.0]])))
TRUTH = BLOCK.true_images, BLOCK.true_points


def _start(turn: Any = 1.0) -> tuple[Any, Any, Any]:
    images, points = TRUTH
    assert images is not None
    assert points is not None
    rotation = images.ground_from_image @ np.diag([1.0, -1.0, -1.0]) if turn != 1.0 else images.ground_from_image
    return images.position_m * [1, 1, turn], rotation, points.xyz_m * [1, 1, turn]


def test_a_line_per_camera_tells_its_height() -> None:
    position, rotation, xyz = _start()
    height = np.median((position[:, None, 2] - xyz[None, :, 2]).ravel())
    (finding,) = unlikely_orientations(BLOCK, position, rotation, xyz)
    assert (finding.level, finding.where) == ("note", "camera cam")
    assert finding.sentence == f"{height:.0f} m above its points"


def test_cameras_that_look_up_and_points_behind_them_are_warned_of() -> None:
    _, warning = unlikely_orientations(BLOCK, *_start(turn=-1.0))
    assert "look up at points above them" in warning.sentence
    position, rotation, xyz = _start()
    _, warning = unlikely_orientations(BLOCK, position, rotation, xyz * [1, 1, 100.0])
    assert "of its points lie behind it" in warning.sentence


def test_a_model_that_nothing_sets_upright_may_look_up() -> None:
    ground = BLOCK.ground_points
    unknown = replace(ground, role=np.full_like(ground.role, NO_ROLE))
    local = replace(BLOCK, ground_points=unknown, frames=replace(BLOCK.frames, crs=np.array(["local"])))
    assert all(finding.level == "note" for finding in unlikely_orientations(local, *_start(turn=-1.0)))


def test_control_outside_of_what_its_images_show_is_named() -> None:
    position, rotation, _ = _start()
    (line,) = control_outside(BLOCK, position, rotation)
    assert line.sentence == "4 of 4 control points lie in what their images show"
    ground = BLOCK.ground_points
    xyz = ground.xyz_m.copy()
    xyz[0, 1] += 7_400.0
    line, warning = control_outside(replace(BLOCK, ground_points=replace(ground, xyz_m=xyz)), position, rotation)
    assert line.sentence.startswith("3 of 4")
    assert warning.rows["control"].tolist() == [0]
    assert [name.split()[0] for name in warning.ids] == [str(BLOCK.points.id[ground.point[0]])]


def test_where_most_control_is_outside_its_images_the_orientations_are_blamed_and_no_coordinates() -> None:
    """Angles in the order kappa, phi, omega for omega, phi, kappa called all 16 control points of a block wrong."""
    position, rotation, _ = _start()
    to_the_side = rotation @ np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    _, warning = control_outside(BLOCK, position, to_the_side)
    assert warning.sentence == "4 of 4 control points lie outside of what their images show"
    assert not warning.rows
    assert "angles" in warning.remedy


def test_images_that_an_adjustment_turns_over_are_told_and_one_alone_is_not() -> None:
    """Mirrored images of flat ground fit from below it, with the residuals of the right ones from above."""
    position, rotation, _ = _start()
    above, below, of = Poses(position, rotation), Poses(*_start(turn=-1.0)[:2]), BLOCK.images.camera
    (finding,) = turned_over(above, below, of, BLOCK.cameras.id)
    assert (finding.level, finding.where) == ("warning", "camera cam")
    assert "the other way than at the start" in finding.sentence
    assert "y axis" in finding.remedy
    assert not turned_over(above, above, of, BLOCK.cameras.id)
    assert not turned_over(above, below.where(np.arange(len(of)) == 0, above), of, BLOCK.cameras.id)


@pytest.mark.parametrize(
    ("method", "oriented", "count"),
    [("strip_adjustment/polynomial", 4, 1), ("strip_adjustment/polynomial", 5, 0), ("initial_orientation/graph", 4, 0)],
)
def test_an_adjustment_that_fails_from_few_images_of_strips_is_told_how_to_begin(
    method: str, oriented: int, count: int
) -> None:
    solution = made_solution(BLOCK, method=method)
    flags = np.arange(len(solution.images.oriented)) < oriented  # of ten
    findings = few_oriented(replace(solution, images=replace(solution.images, oriented=flags)))
    assert [f.remedy.split()[1] for f in findings] == count * ["initial_orientation/graph"]


def test_a_block_in_millimetres_flies_higher_than_any_aircraft() -> None:
    position, rotation, xyz = _start()
    (line,) = unlikely_orientations(BLOCK, 1000 * position, rotation, 1000 * xyz)
    assert line.level == "warning"
    assert "unit of control" in line.remedy
