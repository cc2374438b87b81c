"""Absolute orientation of a component by control of all kinds."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.errors import GeometryError
from aatri.geometry.rotations import exp_rotation
from aatri.geometry.similarity import Similarity, inverse, transform
from aatri.orientation.bodies.absolute import orient_component
from aatri.orientation.bodies.datum import Datum

RNG = np.random.default_rng(9)
TRUE = Similarity(np.array([500.0, 400.0, 100.0]), 220.0, exp_rotation(np.array([0.02, -0.03, 2.0])))
BODY = np.column_stack([RNG.uniform(0, 2000, 60), RNG.uniform(0, 1200, 60), RNG.uniform(0, 40, 60)])
ALL, PLAN, HEIGHT = (True, True, True), (True, True, False), (False, False, True)
CORNERS = np.array([[0.0, 0, 10], [2000, 0, 20], [0, 1200, 30], [2000, 1200, 15]])


def _orient(ground, given, *, sigma=0.0, error=0.0, offset=None, model_noise=0.0):
    ground = np.asarray(ground, dtype=float)
    n = len(ground)
    offset = np.zeros((n, 3)) if offset is None else offset
    back = inverse(TRUE)
    x = transform(back, ground - offset @ TRUE.rotation.T) + RNG.normal(0, model_noise / TRUE.scale, (n, 3))
    datum = Datum(
        name=tuple(f"point {k + 1}" for k in range(n)),
        x=x,
        covariance=np.tile(np.eye(3) * 1e-8, (n, 1, 1)),
        offset_m=offset,
        xyz_m=ground + error,
        covariance_m2=np.tile(np.eye(3) * sigma**2, (n, 1, 1)),
        given=np.array(given),
    )
    return orient_component(datum, transform(back, BODY), TRUE.rotation.T @ [0.02, 0.01, 1.0], what="component 1")


def _error(found):
    return np.abs(transform(found.ground_from_component, transform(inverse(TRUE), BODY)) - BODY).max()


@pytest.mark.parametrize(
    "given", [[ALL] * 4, [ALL, ALL, HEIGHT, HEIGHT], [PLAN, ALL, HEIGHT, ALL], [HEIGHT, PLAN, ALL, HEIGHT]]
)
def test_full_plan_only_and_height_only_control_orient_exactly(given):
    assert _error(_orient(CORNERS, given)) < 1e-8


def test_separate_plan_and_height_points_orient_exactly():
    ground = np.concatenate([CORNERS, CORNERS + np.array([100.0, 50.0, 5.0])])
    assert _error(_orient(ground, [PLAN] * 4 + [HEIGHT] * 4)) < 1e-8


def test_antenna_positions_with_lever_arm_orient_exactly():
    stations = CORNERS + np.array([0, 0, 400.0])
    offset = np.array([[1.0, 2.0, -0.5], [1.1, 1.9, -0.5], [-1.0, -2.0, -0.4], [1.0, 2.0, -0.5]])
    assert _error(_orient(stations, [ALL] * 4, sigma=0.1, offset=offset)) < 1e-8


@pytest.mark.parametrize(
    ("ground", "given", "named"),
    [
        (CORNERS[:2], [ALL] * 2, "rotation about the line through point 1 and point 2"),
        (CORNERS[:1], [ALL], "scale"),
        (CORNERS, [PLAN] * 4, "height"),
        (CORNERS, [PLAN, PLAN, HEIGHT, ALL], "not determined: rotation about the line through point 3 and point 4 ("),
        (CORNERS, [HEIGHT] * 4, "azimuth"),
        (CORNERS, [HEIGHT] * 4, "shift in X"),
        (
            CORNERS[[0, 0, 0]] + np.outer([0, 1, 2], [800.0, 500, 0]),
            [ALL] * 3,
            "rotation about the line through point 1 and point 3",
        ),
    ],
)
def test_what_control_leaves_open_is_named(ground, given, named):
    with pytest.raises(GeometryError, match="component 1: not determined: ") as raised:
        _orient(ground, given)
    assert named in str(raised.value)
    assert "known in X, Y and Z" in str(raised.value)


def test_control_only_almost_on_a_line_is_refused_too():
    ground = CORNERS[[0, 0, 0, 0]] + np.outer([0, 1, 2, 3], [600.0, 200, 0]) + RNG.normal(0, 5, (4, 3))
    with pytest.raises(GeometryError, match="rotation about the line"):
        _orient(ground, [ALL] * 4)


def test_collinear_control_is_enough_with_one_height_off_the_line():
    ground = [[0.0, 0, 0], [1000, 0, 5], [2000, 0, 3], [900, 1100, 12]]
    assert _error(_orient(ground, [ALL, ALL, ALL, HEIGHT])) < 1e-8


def test_no_control_at_all_says_so():
    with pytest.raises(GeometryError, match="no control point and no observed position"):
        _orient(np.zeros((0, 3)), np.zeros((0, 3), dtype=bool))


def test_mirrored_control_is_refused():
    datum_ground = CORNERS[:, [1, 0, 2]]
    back = transform(inverse(TRUE), CORNERS)
    datum = Datum(
        ("a", "b", "c", "d"),
        back,
        np.tile(np.eye(3) * 1e-8, (4, 1, 1)),
        np.zeros((4, 3)),
        datum_ground * [1, 1, 0.0],
        np.zeros((4, 3, 3)),
        np.ones((4, 3), dtype=bool),
    )
    with pytest.raises(GeometryError, match="mirrored"):
        orient_component(datum, transform(inverse(TRUE), BODY), TRUE.rotation.T @ [0, 0, 1.0], what="component 1")


def test_wrong_control_is_rejected_and_its_size_estimated():
    ground = np.concatenate([CORNERS, RNG.uniform([0, 0, 0], [2000, 1200, 30], (12, 3))])
    error = np.zeros((16, 3))
    error[6] = [0.0, 2.0, 0.0]
    found = _orient(ground, [ALL] * 16, sigma=0.02, error=error, model_noise=0.02)
    assert np.flatnonzero(~found.active).tolist() == [6]
    assert found.tied.size[16 + 6, 1] == pytest.approx(2.0, abs=0.15)
    assert _error(found) < 0.1


def test_precise_control_and_weaker_positions_work_together():
    ground = np.concatenate([CORNERS, CORNERS * 0.9 + [0, 0, 400.0]])
    error = np.concatenate([np.zeros((4, 3)), np.tile([0.5, 0, 0], (4, 1))])
    C = np.concatenate([np.tile(np.eye(3) * 0.01**2, (4, 1, 1)), np.tile(np.eye(3) * 1.0, (4, 1, 1))])
    back = inverse(TRUE)
    datum = Datum(
        tuple("abcdefgh"),
        transform(back, ground),
        np.tile(np.eye(3) * 1e-10, (8, 1, 1)),
        np.zeros((8, 3)),
        ground + error,
        C,
        np.ones((8, 3), dtype=bool),
    )
    found = orient_component(datum, transform(back, BODY), TRUE.rotation.T @ [0, 0, 1.0], what="component 1")
    # Weights 1 : 10,000: the systematic 0.5 m of the positions hardly moves the block.
    assert _error(found) < 0.002
