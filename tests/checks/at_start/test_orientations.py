"""Orientations held against points and control: a line per camera, what no flight has, control outside of its
images."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aatri.artifacts.block_tables import Exterior
from aatri.checks.at_start.orientations import control_outside, few_oriented, turned_over, unlikely_orientations
from aatri.checks.at_start.start_rays import start_rays
from aatri.codes import NO_ROLE
from aatri.geometry.rotations import angles_from_rotation, rotation_from_angles
from aatri.observations.image_point_rows import ImagePointRows
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


@pytest.mark.parametrize(
    ("change", "reading"),
    [
        (lambda a: -a, "omega, phi, kappa of opposite sign"),
        (lambda a: a[:, [2, 1, 0]], "a1 and a3 exchanged"),
        (np.deg2rad, "radians, declared as degrees"),
    ],
)
def test_angles_of_a_start_in_another_convention_are_read_by_their_rays(change: Any, reading: str) -> None:
    """All angles of opposite sign: 21 oblique images did not converge, and no word was said of the angles."""
    block, rays, poses = _oblique()
    angles = change(angles_from_rotation(poses.ground_from_image))
    (finding,) = start_rays(*_declared(block, rays, poses, angles))
    assert (finding.level, finding.cause) == ("warning", "start_rays")
    assert reading in finding.sentence


def test_mirrored_images_are_seen_by_the_start_of_another_program() -> None:
    """Without control they fit a mirrored object with the same residuals, and no word was said."""
    block, rays, poses = _oblique()
    mirrored = replace(rays, xy_mm=rays.xy_mm * [1.0, -1.0])
    angles = angles_from_rotation(poses.ground_from_image)
    (finding,) = start_rays(*_declared(block, mirrored, poses, angles))
    assert "with y of the image coordinates the other way" in finding.sentence


def test_two_images_with_each_others_start_are_named() -> None:
    block, rays, poses = _oblique()
    order = np.arange(len(poses.position_m))
    order[[2, 7]] = 7, 2
    exchanged = Poses(poses.position_m[order], poses.ground_from_image[order])
    (finding,) = start_rays(*_declared(block, rays, exchanged, angles_from_rotation(exchanged.ground_from_image)))
    assert finding.ids == tuple(block.images.id[[2, 7]].tolist())
    assert "start orientations exchanged" in finding.sentence


def test_poor_angles_of_a_start_are_in_no_other_convention() -> None:
    block, rays, poses = _oblique()
    rng, right = np.random.default_rng(5), angles_from_rotation(poses.ground_from_image)
    for _ in range(5):
        angles = right + np.deg2rad(rng.uniform(2, 40)) * rng.normal(size=right.shape)
        findings = start_rays(*_declared(block, rays, poses, angles))
        assert all(finding.level == "note" for finding in findings)
    assert not start_rays(*_declared(block, rays, poses, right))


def _oblique() -> tuple[Any, ImagePointRows, Poses]:
    """The images of the made block, turned by some 30 degrees each its own way; their rays to all its points."""
    images, points = TRUTH
    assert images is not None
    assert points is not None
    n = len(images.position_m)
    angles = np.random.default_rng(4).uniform(-0.6, 0.6, (n, 3)) * [1, 1, 4]
    poses = Poses(images.position_m, rotation_from_angles(angles))
    image, point = (a.ravel() for a in np.indices((n, len(points.xyz_m))))
    u = np.einsum("nji,nj->ni", poses.ground_from_image[image], points.xyz_m[point] - poses.position_m[image])
    c, k = 100.0, len(image)
    image, point, xy = image.astype(np.int32), point.astype(np.int32), -c * u[:, :2] / u[:, 2:]
    rays = ImagePointRows(image, point, xy, np.full((k, 2), 0.01), np.full(k, c), np.zeros((k, 2)), u[:, 2] < 0)
    return BLOCK, rays, poses


def _declared(block: Any, rays: ImagePointRows, poses: Poses, angles: Any) -> tuple[Any, ImagePointRows, Poses]:
    """The same with these angles."""
    n = len(angles)
    exterior = Exterior.of(
        image=np.arange(n),
        position_m=poses.position_m,
        position_covariance_m2=np.full((n, 3, 3), np.nan),
        angles_rad=angles,
        angle_sigma_rad=np.full((n, 3), np.nan),
        position_use=np.zeros(n, int),
        angle_use=np.zeros(n, int),
        refers_to=np.zeros(n, int),
        drift_group=[""] * n,
        file=np.full(n, -1),
        line=np.zeros(n, int),
    )
    return replace(block, exterior=exterior), rays, Poses(poses.position_m, rotation_from_angles(angles))
