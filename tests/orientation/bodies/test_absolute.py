"""Absolute orientation of a body by control and positions of all kinds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.artifacts.builder import block_of
from aatri.errors import ConvergenceError, GeometryError
from aatri.orientation.bodies.absolute import OrientationSettings
from aatri.orientation.bodies.datum_analysis import OpenDatumError
from aatri.orientation.bodies.ground_observed import GroundObserved, oriented_by
from aatri.orientation.bodies.one_left_out import oriented_by_the_others
from tests.orientation.bodies.made_body import ALL, CORNERS, HEIGHT, LIMIT, PLAN, TRUE, MadeBody, active, off_m


def by_control(ground, given):
    made = MadeBody(np.asarray(ground, dtype=float).reshape(-1, 3))
    return made.control(range(len(ground)), given, 0.0).oriented()


@pytest.mark.parametrize(
    "given", [[ALL] * 4, [ALL, ALL, HEIGHT, HEIGHT], [PLAN, ALL, HEIGHT, ALL], [HEIGHT, PLAN, ALL, HEIGHT]]
)
def test_full_plan_only_and_height_only_control_orient_exactly(given) -> None:
    assert off_m(by_control(CORNERS, given).ground_from_body) < 1e-7


def test_separate_plan_and_height_points_orient_exactly() -> None:
    ground = np.concatenate([CORNERS, CORNERS + np.array([100.0, 50.0, 5.0])])
    assert off_m(by_control(ground, [PLAN] * 4 + [HEIGHT] * 4).ground_from_body) < 1e-7


def test_antenna_positions_with_lever_arm_orient_exactly() -> None:
    arm = np.array([[1.0, 2.0, -0.5], [1.1, 1.9, -0.5], [-1.0, -2.0, -0.4], [1.0, 2.0, -0.5]])
    made = MadeBody(CORNERS, CORNERS + np.array([0, 0, 400.0])).positions(0.1, arm)
    assert off_m(made.oriented().ground_from_body) < 1e-6


@pytest.mark.parametrize(
    ("ground", "given", "named"),
    [
        (CORNERS[:2], [ALL] * 2, "rotation about the line through point 1 and point 2"),
        (CORNERS[:1], [ALL], "scale"),
        (CORNERS, [PLAN] * 4, "shift Z"),
        (CORNERS, [PLAN, PLAN, HEIGHT, ALL], "not determined: rotation about the line through point 3 and point 4 ("),
        (CORNERS, [HEIGHT] * 4, "rotation about Z"),
        (CORNERS, [HEIGHT] * 4, "shift X"),
        (
            CORNERS[[0, 0, 0]] + np.outer([0, 1, 2], [800.0, 500, 0]),
            [ALL] * 3,
            "rotation about the line through point 1 and point 3",
        ),
    ],
)
def test_what_control_leaves_open_is_named(ground, given, named: str) -> None:
    with pytest.raises(GeometryError, match="component 1: not determined: ") as raised:
        by_control(ground, given)
    assert named in str(raised.value)
    assert "known in X, Y and Z" in str(raised.value)


def test_control_only_almost_on_a_line_is_refused_too() -> None:
    off = np.random.default_rng(9).normal(0, 5, (4, 3))
    ground = CORNERS[[0, 0, 0, 0]] + np.outer([0, 1, 2, 3], [600.0, 200, 0]) + off
    with pytest.raises(GeometryError, match="rotation about the line"):
        by_control(ground, [ALL] * 4)


def test_collinear_control_is_enough_with_one_height_off_the_line() -> None:
    ground = [[0.0, 0, 0], [1000, 0, 5], [2000, 0, 3], [900, 1100, 12]]
    assert off_m(by_control(ground, [ALL, ALL, ALL, HEIGHT]).ground_from_body) < 1e-7


@pytest.mark.parametrize("share", [0.05, 0.5])
def test_a_point_at_infinity_does_not_decide_about_the_datum(share: float) -> None:
    """280 times as far as the others, and known to a share of that: what it moves by a change of scale is nothing."""
    made = MadeBody(CORNERS).control(range(4), [ALL] * 4, 0.02)
    alone = made.oriented()
    body, middle = made.body, made.body.poses.position_m.mean(axis=0)
    far = middle + 280 * (body.xyz[-1] - middle)
    covariance = (share * np.linalg.norm(far - middle)) ** 2 / 3 * np.eye(3)
    made.body = replace(
        body,
        xyz=np.append(body.xyz, far[None], axis=0),
        covariance=np.append(body.covariance, covariance[None], axis=0),
    )
    found = made.oriented()
    assert found.analysis.extrapolation == pytest.approx(alone.analysis.extrapolation, rel=1e-9)
    assert off_m(found.ground_from_body, alone.ground_from_body) < 1e-9


def test_no_control_at_all_says_so() -> None:
    with pytest.raises(GeometryError, match="no control point and no observed position"):
        by_control(np.zeros((0, 3)), np.zeros((0, 3), dtype=bool))


def test_mirrored_control_is_refused() -> None:
    mirrored = CORNERS[:, [1, 0, 2]] * [1.0, 1.0, 0.0] - CORNERS
    with pytest.raises(GeometryError, match="mirrored"):
        MadeBody(CORNERS).control(range(4), [ALL] * 4, 0.0, mirrored).oriented()


def test_wrong_control_is_rejected_and_its_size_estimated() -> None:
    ground = np.concatenate([CORNERS, np.random.default_rng(9).uniform([0, 0, 0], [2000, 1200, 30], (12, 3))])
    error = np.zeros((16, 3))
    error[6] = [0.0, 2.0, 0.0]
    found = MadeBody(ground, off_m=0.02).control(range(16), [ALL] * 16, 0.02, error).oriented()
    assert active(found, "control") == [k != 6 for k in range(16)]
    assert found.tied.size[found.tied.of("control")[6], 1] == pytest.approx(2.0, abs=0.15)
    assert off_m(found.ground_from_body) < 0.1


def test_precise_control_and_weaker_positions_work_together() -> None:
    made = MadeBody(CORNERS, CORNERS * 0.9 + [0, 0, 400.0], stated_m=0.0022)
    found = made.control(range(4), [ALL] * 4, 0.01).positions(1.0, error=np.array([0.5, 0, 0])).oriented()
    # Weights 1 : 10,000: the systematic 0.5 m of the positions hardly moves the block.
    assert off_m(found.ground_from_body) < 0.002


@pytest.mark.slow
def test_photographs_towards_a_wall_are_oriented_by_places_hardly_off_their_line() -> None:
    """No heading of an image that looks down is near; control far from the positions, which are poor."""
    along, across = np.array([0.0, 0.0, 700.0, 1600.0]), np.array([150.0, 0.0, 250.0, 500.0])
    along[0] = 5500.0
    places = np.outer(along, [0.6, 0.8, 0.0]) + np.outer(across, [-0.8, 0.6, 0.0]) + [0.0, 0.0, 60.0]
    made = MadeBody(places[:1], places[1:])
    upright = np.array([[1.0, 0, 0], [0, 0, 1.0], [0, -1.0, 0]])
    poses = replace(made.body.poses, ground_from_image=made.body.poses.ground_from_image @ upright)
    made.body = replace(made.body, poses=poses)
    error = np.array([[6.0, -8.0, 15.0], [-7.0, 2.0, -12.0], [4.0, 6.0, 20.0]])
    oriented = made.control([0], [ALL], 0.0).positions(12.0, error=error).oriented()
    assert np.linalg.norm(oriented.ground_from_body.translation - TRUE.translation) < 100.0


@pytest.mark.parametrize("stiff", [False, True])
def test_two_images_far_apart_with_each_others_position_are_rejected(stiff: bool) -> None:
    """Least squares would turn the body over: the products of the coordinates along the strip sum up below zero."""
    along = np.append(np.arange(-4.0, 5.0), [-1.0, 0.0, 1.0])
    across = np.append(np.zeros(9), np.ones(3))
    centres = np.column_stack([1000 + 400 * along, 300 + 600 * across, np.full(12, 1500.0)])
    error = np.zeros((12, 3))
    error[[0, 8]] = centres[[8, 0]] - centres[[0, 8]]
    made = MadeBody(CORNERS, centres, off_m=0.02).positions(0.1, error=error)
    oriented = made.oriented(stiff=stiff)
    assert active(oriented, "position") == [k not in (0, 8) for k in range(12)]
    assert off_m(oriented.ground_from_body) < 0.3


def on_ground(made: MadeBody) -> GroundObserved:
    """What is observed of a made body, as that of a block."""
    cameras, images = {"id": ["c"], "principal_distance_mm": 100.0}, {"id": ["0", "1"], "camera": ["c", "c"]}
    points = [str(k) for k in range(len(made.body.xyz))]
    block = block_of(name="body", cameras=cameras, images=images, points=points)
    return GroundObserved(block, block, np.zeros(3), False, None, None, beside=tuple(made.observed))


def test_where_a_body_fails_it_lies_without_the_one_distance_that_contradicts_all_else() -> None:
    made = MadeBody(CORNERS).control(range(4), [ALL] * 4, 0.01)
    made.distances([0, 1], [3, 2], 0.01, np.array([0.0, 5.0]))
    settings, failure = OrientationSettings(LIMIT, stiff=True), ConvergenceError("it does not fit")
    oriented, _ = oriented_by_the_others(on_ground(made), made.body, settings, "component 1", failure)
    assert active(oriented, "distance") == [True, False]
    assert off_m(oriented.ground_from_body) < 1e-6


def test_what_all_observations_leave_open_is_refused_without_a_trial_of_fewer(monkeypatch) -> None:
    made = MadeBody(CORNERS).control([0], [ALL], 0.01).control([1, 2, 3], [HEIGHT] * 3, 0.01)
    made.distances([0, 1], [3, 2], 0.01, np.zeros(2))
    ground, settings = on_ground(made), OrientationSettings(LIMIT, stiff=True)
    with pytest.raises(OpenDatumError, match=r"not determined: .*rotation about Z") as failure:
        oriented_by(ground, made.body, settings, "component 1")
    monkeypatch.setattr("aatri.orientation.bodies.one_left_out.oriented_by", None)  # nothing calls it
    with pytest.raises(OpenDatumError) as same:
        oriented_by_the_others(ground, made.body, settings, "component 1", failure.value)
    assert same.value is failure.value
