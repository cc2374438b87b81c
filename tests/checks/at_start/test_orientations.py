"""Orientations held against points and control: a line per camera, what no flight has, control outside of its
images."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from aatri.checks.at_start.exchanged_marks import exchanged_marks
from aatri.checks.at_start.orientations import control_outside, unlikely_orientations
from aatri.codes import NO_ROLE
from aatri.observations.poses import Poses
from aatri.stages.image_refinement.systematic import systematic
from aatri.stages.interior_orientation.affine import affine
from tests.made_solutions import made_block
from tests.stages.chain import simulated

MADE = made_block()
BLOCK = replace(MADE, cameras=replace(MADE.cameras, format=np.array([[600.0, 600.0]])))
TRUTH = BLOCK.true_images, BLOCK.true_points


FLIGHT = {"strips": 2, "images_per_strip": 4, "cross_strips": 0}
FILMS: dict[str, Any] = {"preset": "rc30", "flight": FLIGHT, "ties": {"new_points": 120}}


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


def test_film_images_with_each_others_image_points_are_named() -> None:
    """The start is the truth of the photographs: it knows the image points, whatever name they carry."""
    block = simulated(1, **FILMS)
    assert _of_marks(block, [0, 1, 2, 3, 4, 5, 6, 7]) == []
    for pair in ([1, 2], [2, 6]):
        photograph = np.arange(len(block.images))
        photograph[pair] = pair[::-1]
        names = tuple(block.images.id[pair])
        m = block.image_points
        exchanged = replace(block, image_points=replace(m, image=photograph[m.image].astype(m.image.dtype)))
        (finding,) = _of_marks(exchanged, photograph)
        assert finding.level == "warning", "a start bent by wrong control looks alike: the run goes on"
        assert set(finding.sentence.split()[1:4:2]) == set(names)


def test_a_film_image_with_a_mark_off_is_not_exchanged_with_another() -> None:
    block = simulated(1, **FILMS)
    marks = block.fiducial_points
    xy = marks.xy.copy()
    xy[np.isin(marks.image, [2, 5])] += np.random.default_rng(1).normal(0.0, 0.02, (8, 2))
    assert _of_marks(replace(block, fiducial_points=replace(marks, xy=xy)), np.arange(len(block.images))) == []


def _of_marks(block: Any, photograph: Any) -> Any:
    assert block.true_images is not None
    assert block.true_points is not None
    points = systematic(block=block, image_points=affine(block=block))
    truth = block.true_images
    poses = Poses(truth.position_m[photograph], truth.ground_from_image[photograph])
    return exchanged_marks(block, points, poses, block.true_points.xyz_m)
