"""The frame tp of two points."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.errors import GeometryError
from aatri.geometry.two_point import two_point_frame


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
