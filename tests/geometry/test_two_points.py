"""Collinearity and the orientation from two points."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.errors import GeometryError
from aatri.geometry.collinearity import collinearity, in_image_axes, project
from aatri.geometry.rotations import rotation_from_angles, skew
from aatri.geometry.two_point import two_point_frame
from tests.complex_step import complex_step

# Collinearity: sign conventions and exact derivatives.


def test_a_point_to_the_east_of_a_vertical_image_has_positive_x() -> None:
    # 1:1000 from 150 m: 10 m east is 10 mm, 20 m north is 20 mm
    u = in_image_axes(np.array([[0.0, 0.0, 150.0]]), np.eye(3)[None], np.array([[10.0, 20.0, 0.0]]))
    np.testing.assert_allclose(project(u, np.array([150.0])), [[10.0, 20.0]])


@pytest.mark.parametrize("seed", range(20))
def test_derivatives_equal_the_complex_step(seed: int) -> None:
    rng = np.random.default_rng(seed)
    R = rotation_from_angles(rng.uniform(-3, 3, 3))
    X0 = rng.normal(0, 100, 3)
    X = X0 + R @ np.array([rng.uniform(-50, 50), rng.uniform(-50, 50), -rng.uniform(50, 500)])

    def f(unknowns: np.ndarray) -> np.ndarray:
        # written out anew: small turn about the ground axes, then projection
        turn = np.eye(3) + skew(unknowns[3:6])
        u = (turn @ R).T @ (unknowns[6:] - unknowns[:3])
        return np.array([-153.84 * u[0] / u[2], -153.84 * u[1] / u[2]])

    expected = complex_step(f, np.concatenate([X0, np.zeros(3), X]))
    xy, by_pose, by_point = collinearity(X0[None], R[None], X[None], np.array([153.84]))
    scale = np.abs(expected).max(axis=0)
    np.testing.assert_allclose(np.hstack([by_pose[0], by_point[0]]) / scale, expected / scale, atol=1e-12)
    np.testing.assert_allclose(xy[0], f(np.concatenate([X0, np.zeros(3), X])).real, rtol=1e-13)


# The frame tp of two points.


def test_there_and_back_is_exact_and_the_second_point_is_met_in_plan() -> None:
    rng = np.random.default_rng(1)
    ground = np.array([4.5e6, 4.46e5, 100.0]) + rng.uniform(-2000, 2000, (20, 3))
    strip = np.array([[0.1, 0.2, -1.5], [9.7, -0.4, -1.2]])
    frame = two_point_frame(strip, ground[:2])
    tp = frame.from_ground(ground)
    assert tp[0] == pytest.approx(strip[0], abs=1e-12)
    assert tp[1, :2] == pytest.approx(strip[1, :2], abs=1e-12)
    assert frame.to_ground(tp) == pytest.approx(ground, abs=1e-9)


def test_left_handed_geodetic_coordinates_become_right_handed_and_keep_their_shape() -> None:
    """From north, east, height (left-handed) of a strip flown north-east, at a scale of 1 : 50."""
    frame = two_point_frame(
        np.array([[0.0, 0, 0], [2.0, 0, 0]]), np.array([[0.0, 0, 0], [70.71067811865476] * 2 + [0]])
    )
    assert frame.scale == pytest.approx(0.02)
    axes = frame.from_ground(np.eye(3)) - frame.from_ground(np.zeros((1, 3)))
    assert np.linalg.det(axes) == pytest.approx(-(0.02**3))  # of left-handed axes: tp is right-handed
    # a point to the right of the flight, in the south-east, has a negative Y
    assert frame.from_ground(np.array([[0.0, 10.0, 0.0]]))[0] == pytest.approx([0.2 / 2**0.5, -0.2 / 2**0.5, 0])


def test_two_points_of_one_place_are_refused() -> None:
    with pytest.raises(GeometryError, match="same place"):
        two_point_frame(np.zeros((2, 3)), np.array([[0.0, 0, 0], [1, 1, 1]]))


def test_points_side_by_side_or_one_after_the_other_make_a_frame() -> None:
    for strip in ([[0.0, 0, 0], [0, 2, 0]], [[0.0, 0, 0], [2, 0, 0]]):
        for ground in ([[0.0, 0, 0], [0, 100, 0]], [[0.0, 0, 0], [100, 0, 0]]):
            assert two_point_frame(np.array(strip), np.array(ground)).scale == pytest.approx(0.02)
