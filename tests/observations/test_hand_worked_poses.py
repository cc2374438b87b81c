"""Whiteners and poses against results worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.adjustment.whitening import whitener_of_covariances, whitener_of_sigmas
from aatri.geometry.rotations import exp_rotation
from aatri.observations.poses import POINT, POSE, CommonTurn, Poses, pose_unknowns, retract_poses
from tests.observations.test_hand_worked import QUARTER


def test_whiteners() -> None:
    np.testing.assert_array_equal(whitener_of_sigmas(np.array([[0.5, np.nan], [np.inf, 4.0]])), [[2, 0], [0, 0.25]])
    assert whitener_of_covariances(np.zeros((0, 3, 3))).shape == (0, 3, 3)
    L = whitener_of_covariances(np.array([[[4.0, 2.0], [2.0, 9.0]]]))[0]
    np.testing.assert_allclose(L @ [[4.0, 2.0], [2.0, 9.0]] @ L.T, np.eye(2), atol=1e-12)
    assert L[0, 1] == 0.0


def test_poses_turn_on_the_ground_side() -> None:
    step = np.array([[1.0, 2.0, 3.0, 0.0, 0.0, np.pi / 2], [0, 0, 0, np.pi / 2, 0, 0]])
    moved = retract_poses(Poses(np.array([[10.0, 20.0, 30.0], [0, 0, 0]]), np.stack([QUARTER, QUARTER])), step)
    np.testing.assert_allclose(moved.position_m, [[11, 22, 33], [0, 0, 0]])
    np.testing.assert_allclose(moved.ground_from_image[0], np.diag([-1.0, -1.0, 1.0]), atol=1e-15)
    about_X = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    np.testing.assert_allclose(moved.ground_from_image[1], about_X @ QUARTER, atol=1e-15)


def test_the_unknowns_of_poses_lie_at_their_plan_positions() -> None:
    free = np.ones((2, 6), dtype=bool)
    unknowns = pose_unknowns(["a", "b"], free, np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]))
    assert unknowns.position is not None
    assert unknowns.position.tolist() == [[1, 2], [4, 5]]
    assert unknowns.label(1, 4) == "rotation about Y of image b"
    assert not unknowns.eliminated


def test_an_image_turns_about_the_place_it_sees() -> None:
    """From 100 m above the origin, looking down; turned by w about X the place moves by 100 w along the ground."""
    w, above = 0.3, np.array([[0.0, 0.0, 100.0]])
    start = Poses(above, np.eye(3)[None])
    turned = retract_poses(start, np.array([[0, 0, 0, w, 0, 0]]), np.array([100.0]))
    np.testing.assert_allclose(turned.position_m, [[0, 100 * (w - np.sin(w)), 100 * np.cos(w)]], atol=1e-12)
    place = turned.position_m - 100 * turned.ground_from_image[:, :, 2]
    np.testing.assert_allclose(place, [[0, 100 * w, 0]], atol=1e-12)
    lower = retract_poses(start, np.array([[0, -100 * w, -20, w, 0, 0]]), np.array([100.0]))
    place = lower.position_m - 80 * lower.ground_from_image[:, :, 2]
    np.testing.assert_allclose(place, [[0, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(lower.position_m), 80, rtol=1e-12)


def test_however_an_image_turns_small_steps_are_the_same() -> None:
    rng = np.random.default_rng(1)
    start = Poses(rng.normal(size=(5, 3)), exp_rotation(rng.normal(size=(5, 3))))
    step, seen_at_m = 1e-4 * rng.normal(size=(5, 6)), np.array([0.0, 10, 100, 3, 50])
    plain, about = retract_poses(start, step), retract_poses(start, step, seen_at_m)
    np.testing.assert_array_equal(plain.position_m[0], about.position_m[0])
    np.testing.assert_allclose(about.position_m, plain.position_m, atol=100 * 10 * 1e-8)
    np.testing.assert_array_equal(about.ground_from_image, plain.ground_from_image)


@pytest.mark.parametrize(("goes", "scale"), [(1.0, 1.0), (1.0, 1.1), (0.0, 1.0)])
def test_a_block_that_turns_at_one_step_is_turned_and_one_whose_points_stay_is_not_bent(
    goes: float, scale: float
) -> None:
    """Linear steps t x X of a similarity about the mean of the centres: the finite turn, the scale to first order."""
    rng = np.random.default_rng(3)
    t, shift = np.array([0.4, -0.1, 0.2]), np.array([5.0, 6.0, 7.0])
    centres, xyz = rng.normal(0, 50, (6, 3)), rng.normal(0, 100, (40, 3))
    centres -= centres.mean(axis=0)
    before = {POSE: Poses(centres, exp_rotation(rng.normal(size=(6, 3)))), POINT: xyz}
    free = {POSE: np.ones((6, 6), dtype=bool), POINT: np.ones((40, 3), dtype=bool)}
    free[POINT][0] = False  # an exact control point
    moved = {group: shift + np.cross(t, x) + (scale - 1) * x for group, x in ((POSE, centres), (POINT, xyz))}
    step = {POSE: np.hstack([moved[POSE], np.tile(t, (6, 1))]), POINT: goes * moved[POINT] * free[POINT]}
    linear = {POSE: retract_poses(before[POSE], step[POSE]), POINT: xyz + step[POINT]}
    after = CommonTurn(free)(before, linear, step)
    if goes:
        exactly = [shift + x @ exp_rotation(t).T + (scale - 1) * x for x in (centres, xyz)]
    else:
        exactly = [linear[POSE].position_m, xyz]
    np.testing.assert_allclose(after[POSE].position_m, exactly[0], atol=1e-12)
    np.testing.assert_allclose(after[POINT][1:], exactly[1][1:], atol=1e-12)
    np.testing.assert_array_equal(after[POINT][0], xyz[0])
    np.testing.assert_array_equal(after[POSE].ground_from_image, linear[POSE].ground_from_image)
