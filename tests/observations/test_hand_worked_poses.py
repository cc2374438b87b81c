"""Whiteners and poses against results worked out by hand."""

from __future__ import annotations

import numpy as np

from aatri.adjustment.records import (
    whitener_of_covariances,
    whitener_of_sigmas,
)
from aatri.geometry.rotations import exp_rotation
from aatri.observations.poses import Poses, pose_unknowns, retract_poses
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
