"""Control with each other's number, and mirrored control."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aatri.errors import GeometryError
from aatri.geometry.rotations import levelling
from aatri.geometry.similarity import Similarity
from aatri.observations.poses import Poses
from aatri.orientation.bodies.datum_analysis import GivenPlaces
from aatri.orientation.bodies.free_body import concerning
from aatri.orientation.bodies.wrong_control import exchanged_by_all, exchanged_control, refuse_mirrored
from aatri.orientation.bodies.wrong_tables import one_row_off, refuse_wrong
from tests.orientation.bodies.made_body import ALL, CORNERS, HEIGHT, PLAN, MadeBody, active, off_m

# Two of six control points with each other's number are found; single errors and right points are not.


@pytest.mark.parametrize("seed", range(10))
def test_two_of_six_are_found_and_none_else(seed: int) -> None:
    rng = np.random.default_rng(seed)
    X = rng.uniform(0, 1, (6, 3)) * [2000.0, 1500.0, 60.0]
    x = (X @ Rotation.from_rotvec([0.01, 0.02, 1.0]).as_matrix()) * 1e-3 + rng.normal(0, 1e-4, (6, 3))  # 10 cm
    assert not exchanged_control(x, X).any()
    rows = rng.choice(6, 2, replace=False)
    wrong = X.copy()
    wrong[rows] = X[rows[::-1]]
    assert set(np.flatnonzero(exchanged_control(x, wrong)).tolist()) == set(rows.tolist())
    off = X.copy()
    off[rows[0]] += [300.0, -200.0, 10.0]
    assert not exchanged_control(x, off).any()


@pytest.mark.parametrize("seed", range(5))
def test_two_of_three_are_found_beside_positions_which_nobody_exchanges(seed: int) -> None:
    rng = np.random.default_rng(seed)
    X = rng.uniform(0, 1, (12, 3)) * [2000.0, 1500.0, 60.0]
    X[3:, 2] += 1000.0
    x = (X @ Rotation.from_rotvec([0.01, 0.02, 1.0]).as_matrix()) * 1e-3 + rng.normal(0, 1e-4, (12, 3))
    assert not exchanged_control(x, X, 3).any()
    wrong = X.copy()
    wrong[[0, 2]] = X[[2, 0]]
    assert np.flatnonzero(exchanged_control(x, wrong, 3)).tolist() == [0, 2]
    assert not exchanged_control(x[:3], wrong[:3]).any()  # without them two of three cannot be left out


@pytest.mark.parametrize("pair", [(0, 1), (1, 2), (2, 3), (0, 3)])
def test_two_corners_of_a_square_are_told_from_the_other_two_which_fit_mirrored(pair: tuple[int, int]) -> None:
    """With both pairs exchanged the square is turned over: all fit as well, and the images look upwards."""
    X = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    x = X + np.random.default_rng(6).normal(0, 1e-4, X.shape)
    wrong = X.copy()
    wrong[list(pair)] = X[list(pair[::-1])]
    assert not exchanged_control(x, wrong, fewest=4).any()
    assert np.flatnonzero(exchanged_control(x, wrong, fewest=4, up=np.array([0.0, 0.0, 1.0]))).tolist() == list(pair)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("turn", [np.diag([1.0, 1.0, 1.0]), np.diag([1.0, -1.0, -1.0])])
@pytest.mark.parametrize("pair", [(0, 1), (2, 3)])
def test_two_of_four_corners_of_flat_ground_are_named(pair: tuple[int, int], turn: np.ndarray) -> None:
    """However the component lies in its own axes."""
    corners = np.array([[0.0, 0, 10], [1000, 0, 10], [1000, 1000, 10], [0, 1000, 10]])
    error = np.zeros((4, 3))
    error[list(pair)] = corners[list(pair[::-1])] - corners[list(pair)]
    first, second = (f"point {k + 1}" for k in pair)
    with pytest.raises(GeometryError, match=f"{first} and {second} fit with each other's number"):
        _turned(MadeBody(corners), turn).control(range(4), [ALL] * 4, 0.02, error).oriented()


def _turned(made: MadeBody, R: np.ndarray) -> MadeBody:
    """Its covariances are those of spheres, and stay."""
    poses = Poses(made.body.poses.position_m @ R.T, R @ made.body.poses.ground_from_image)
    made.body = replace(made.body, poses=poses, xyz=made.body.xyz @ R.T)
    return made


GROUND = np.concatenate([CORNERS, [[1000.0, 1100.0, 12.0], [1000.0, 100.0, 25.0]]])


@pytest.mark.slow
@pytest.mark.parametrize("pair", [(0, 1), (0, 2), (1, 2)])
def test_two_of_three_full_points_are_found_by_all_that_is_observed(pair: tuple[int, int]) -> None:
    """Three full ones, one in plan, two in height: the rest determines the body alone."""
    given, error = [ALL, ALL, ALL, PLAN, HEIGHT, HEIGHT], np.zeros((6, 3))
    error[list(pair)] = GROUND[list(pair[::-1])] - GROUND[list(pair)]
    found = MadeBody(GROUND, off_m=0.02).control(range(6), given, 0.02, error).oriented()
    assert [k for k, used in enumerate(active(found, "control")) if not used] == list(pair)
    assert off_m(found.ground_from_body) < 0.5


def test_what_two_exchanged_points_leave_open_names_them() -> None:
    given, error = [ALL, ALL, ALL, PLAN], np.zeros((4, 3))
    error[[0, 2]] = GROUND[[2, 0]] - GROUND[[0, 2]]
    with pytest.raises(GeometryError, match="point 1 and point 3 fit with each other's number") as raised:
        MadeBody(GROUND[:4]).control(range(4), given, 0.02, error).oriented()
    assert raised.value.remedy.startswith("exchange the two numbers in the control")


def test_two_exchanged_points_beside_positions_on_a_line_are_named_though_the_turn_about_it_is_open() -> None:
    line = np.column_stack([np.linspace(0.0, 2000.0, 5), np.full(5, 500.0), np.full(5, 1500.0)])
    points = np.array([[100.0, 100.0, 10.0], [1900.0, 900.0, 40.0]])
    made = MadeBody(points, line).control(range(2), [ALL, ALL], 0.02, points[::-1] - points).positions(0.05)
    with pytest.raises(GeometryError, match="point 1 and point 2 fit with each other's number"):
        made.oriented()


@pytest.mark.slow
def test_a_single_wrong_point_is_no_exchange() -> None:
    given, error = [ALL, ALL, ALL, PLAN, HEIGHT, HEIGHT], np.zeros((6, 3))
    error[1] = [400.0, -300.0, 0.0]
    made = MadeBody(GROUND, off_m=0.02).control(range(6), given, 0.02, error)
    observed, use = concerning(made.observed, made.body), np.ones(6, dtype=bool)
    level = Similarity(np.zeros(3), 1.0, levelling(made.body.up))
    assert not len(exchanged_by_all(observed, lambda _: observed, made.body, use, level))


# Control in a plane fits mirrored as well, by chance better: it is not called mirrored.


def places(n: int, relief_m: float, mirrored: bool, seed: int) -> GivenPlaces:
    """Control points of 2 cm on a field of 600 m, and the same points of a body."""
    rng = np.random.default_rng(seed)
    X = rng.uniform([0, 0, -relief_m], [600, 400, relief_m], (n, 3))
    x = X * [1.0, 1.0, -1.0] if mirrored else X
    given = np.ones((n, 3), dtype=bool)
    x = x + rng.normal(0, 0.02, x.shape)
    kind, name = np.full(n, "control"), np.array([f"point {k}" for k in range(n)])
    return GivenPlaces(kind, name, x, X + rng.normal(0, 0.02, X.shape), given, np.arange(n))


@pytest.mark.parametrize(("kind", "blamed"), [("control", "control is mirrored"), ("position", "images have")])
def test_images_that_look_upwards_are_owed_to_what_orients_them(kind: str, blamed: str) -> None:
    few = replace(places(4, 20.0, False, 1), kind=np.full(4, kind))
    up = np.array([0.0, 0.0, -1.0])
    with pytest.raises(GeometryError, match=blamed) as raised:
        refuse_mirrored(few, np.ones(4, dtype=bool), Similarity(np.zeros(3), 1.0, np.eye(3)), up, "body")
    assert ("which control point has which number" in raised.value.remedy) == (kind == "control")


def judged(n: int, relief_m: float, mirrored: bool, seed: int) -> None:
    to = Similarity(np.zeros(3), 1.0, np.eye(3))
    refuse_mirrored(places(n, relief_m, mirrored, seed), np.ones(n, dtype=bool), to, np.array([0.0, 0.0, 1.0]), "body")


@pytest.mark.slow
def test_control_in_a_plane_is_never_mirrored() -> None:
    for seed in range(460):
        judged(5, 0.0, False, seed)


def test_mirrored_control_with_relief_is_refused() -> None:
    for seed in range(5):
        judged(12, 20.0, False, seed)
        with pytest.raises(GeometryError, match="mirrored only"):
            judged(12, 20.0, True, seed)


@pytest.mark.parametrize("seed", range(20))
def test_of_four_points_that_fit_mirrored_none_is_blamed(seed: int) -> None:
    """Any three of them fit turned over; one of four that is wrong does not make them fit mirrored."""
    to, one_rejected = Similarity(np.zeros(3), 1.0, np.eye(3)), np.array([True, True, True, False])
    around = places(4, 400.0, True, seed)
    with pytest.raises(GeometryError, match="mirrored only"):
        refuse_mirrored(around, one_rejected, to, None, "body")
    right = places(4, 400.0, False, seed)
    wrong = np.where(np.arange(4)[:, None] == 3, [300.0, -200.0, 150.0], 0.0)
    refuse_mirrored(replace(right, observed_m=right.observed_m + wrong), one_rejected, to, None, "body")
    refuse_mirrored(right, np.ones(4, dtype=bool), to, None, "body")


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("error_m", [0.0, 100.0])
def test_two_control_points_beside_positions_in_a_plane_tell_that_the_body_is_mirrored(
    seed: int, error_m: float
) -> None:
    """Whatever way the images look, as where attitudes say it; a wrong control point alone does not."""
    rng = np.random.default_rng(seed)
    X = np.array([*([300.0 * k, 400.0 * s, 1000.0] for s in range(3) for k in range(4)), [200, 100, 0], [700, 800, 40]])
    kind, name = np.array(["position"] * 12 + ["control"] * 2), np.array([f"{k}" for k in range(14)])
    given, observed = np.ones((14, 3), dtype=bool), X + rng.normal(0, 0.02, X.shape)
    observed[13, 2] += error_m
    to, use = Similarity(np.zeros(3), 1.0, np.eye(3)), np.ones(14, dtype=bool)
    refuse_mirrored(GivenPlaces(kind, name, X, observed, given, np.arange(14)), use, to, None, "body")
    if not error_m:
        with pytest.raises(GeometryError, match="mirrored only"):
            refuse_mirrored(
                GivenPlaces(kind, name, X * [1, 1, -1], observed, given, np.arange(14)), use, to, None, "body"
            )


@pytest.mark.parametrize("row", [-1, 0, 1])
def test_positions_are_told_to_stand_one_row_off_only_where_they_do(row: int) -> None:
    """Three flights to and fro, every fourth position with an error of its own."""
    X = np.array([[100.0 * (k if s % 2 == 0 else 5 - k), 180.0 * s, 500.0] for s in range(3) for k in range(6)])
    X += np.random.default_rng(1).normal(0, 4.0, X.shape)
    seen, named = X[max(row, 0) : len(X) + min(row, 0)].copy(), X[max(-row, 0) : len(X) - max(row, 0)]
    seen[::4] += [0.0, 25.0, 0.0]
    n = len(seen)
    name = np.array([f"image {k}" for k in range(n)])
    flights = GivenPlaces(np.full(n, "position"), name, seen, named, np.ones((n, 3), dtype=bool), np.arange(n))
    assert ("one row off" in one_row_off(flights)) == (row != 0)
    assert ("that of image 1 fits image 0" in one_row_off(flights)) == (row == 1)


@pytest.mark.parametrize("n", [4, 8])
@pytest.mark.parametrize(("times", "text"), [(1000.0, "in mm"), (1 / 0.3048, "in feet"), (1.1, "")])
def test_heights_of_control_in_another_unit_are_named_where_a_body_does_not_come_to_the_ground(
    n: int, times: float, text: str
) -> None:
    right, to, use = places(n, 60.0, False, n), Similarity(np.zeros(3), 1.0, np.eye(3)), np.ones(n, dtype=bool)
    refuse_wrong(right, use, to, None, "body")
    wrong = replace(right, observed_m=right.observed_m * [1.0, 1.0, times])
    if n == 8:  # one of several may be wrong by itself
        wrong.observed_m[3] += [20.0, 0.0, 0.0]
    with pytest.raises(GeometryError, match=f"heights: they are {text}") if text else nullcontext():
        refuse_wrong(wrong, use, to, None, "body")
