"""One similarity from control, positions, distances and attitudes, with their weights and without what is wrong."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from aatri.errors import GeometryError
from aatri.geometry.similarity import Similarity, transform
from aatri.observations.poses import POSE, Poses
from aatri.observations.ties import BODY
from aatri.orientation.bodies.free_body import observed_rotations, ties_of
from aatri.orientation.bodies.similarity_ties import similarities_of
from tests.orientation.bodies.made_body import ALL, CORNERS, TRUE, MadeBody, active, off_m

ENDS = np.array([[200.0, 300, 12], [1500, 900, 25], [1800, 200, 8]])
HIGH = np.array([[900.0, 500, 400], [1100, 700, 410]])
SIGMA_X, SIGMA_GIVEN, SIGMA_D = 0.02, 0.05, 0.01
START, END = [0, 4, 5, 1, 2], [4, 5, 6, 6, 5]


def given(seed: int, *, distances: bool = True, wrong_m: float = 0.0, error: np.ndarray | float = 0.0) -> MadeBody:
    """Control points, positions, and further points that distances reach; all with normal errors."""
    rng = np.random.default_rng(seed)
    made = MadeBody(np.concatenate([CORNERS, ENDS]), HIGH, SIGMA_X, SIGMA_X, rng=rng)
    made.control(range(4), [ALL] * 4, SIGMA_GIVEN, rng.normal(0, SIGMA_GIVEN, (4, 3)) + error)
    made.positions(SIGMA_GIVEN, error=rng.normal(0, SIGMA_GIVEN, (2, 3)))
    off = rng.normal(0, SIGMA_D, 5)
    off[1] += wrong_m
    return made.distances(START, END, SIGMA_D, off) if distances else made


def by_scipy(made: MadeBody, start: Similarity, tau_m: float) -> Similarity:
    """The same least squares, ground points as unknowns, by another program."""
    control, position, distance = (o.records for o in made.observed)
    x = np.concatenate([made.body.xyz[:7], made.body.poses.position_m])
    sigma_x = np.hypot(start.scale * SIGMA_X / TRUE.scale, tau_m)
    zero, P = np.zeros((len(x), 3)), made.points
    target = -control.evaluate({"point": zero}, np.arange(4))[0]
    centres = -position.evaluate({POSE: Poses(np.zeros((2, 3)), made.rotations)}, np.arange(2))[0]
    known = np.concatenate([target, centres])
    value = np.linalg.norm(P[END] - P[START], axis=1) - distance.evaluate({"point": P}, np.arange(5))[0][:, 0]

    def similarity(p: np.ndarray) -> Similarity:
        turn = Rotation.from_rotvec(p[3:6]).as_matrix()
        return Similarity(start.translation + p[:3], start.scale * np.exp(p[6]), turn @ start.rotation)

    def residuals(p: np.ndarray) -> np.ndarray:
        X = p[7:].reshape(-1, 3)
        parts = [
            (X - transform(similarity(p), x)) / sigma_x,
            (X[[0, 1, 2, 3, 7, 8]] - known) / SIGMA_GIVEN,
            (np.linalg.norm(X[END] - X[START], axis=1) - value) / SIGMA_D,
        ]
        return np.concatenate([part.ravel() for part in parts])

    p0 = np.concatenate([np.zeros(7), transform(start, x).ravel()])
    return similarity(least_squares(residuals, p0, x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-12).x)


def test_control_positions_and_distances_are_adjusted_together_with_their_weights() -> None:
    made = given(3)
    found = made.oriented(stiff=True)
    assert found.tied.active.all()
    expected = by_scipy(made, found.ground_from_body, found.tied.tau_m)
    assert off_m(found.ground_from_body, expected) < 1e-5  # of standard deviations of 1 cm and more
    without = given(3, distances=False).oriented(stiff=True)
    assert off_m(without.ground_from_body, expected) > 1e-3  # the distances do count


def test_a_wrong_distance_is_found_and_does_not_move_the_datum() -> None:
    found = given(3, wrong_m=1.0).oriented(stiff=True)
    assert active(found, "distance") == [True, False, True, True, True]
    assert off_m(found.ground_from_body) < 0.15


def test_a_wrong_control_point_is_found_by_distances_and_the_others() -> None:
    found = given(3, error=np.array([[0.0, 0, 0], [0, 3, 0], [0, 0, 0], [0, 0, 0]])).oriented(stiff=True)
    assert active(found, "control") == [True, False, True, True]
    assert off_m(found.ground_from_body) < 0.15


def on_a_line(seed: int, sigma_rad: float = 0.0, wrong: int | None = None) -> MadeBody:
    """Positions along one strip: the rotation about it is open without attitudes."""
    rng = np.random.default_rng(seed)
    strip = np.column_stack([np.linspace(0, 2000, 9), np.full(9, 600.0), np.full(9, 500.0)])
    made = MadeBody(CORNERS, strip, SIGMA_X, SIGMA_X, rng=rng).positions(0.05)
    if sigma_rad:
        turned = Rotation.from_rotvec(rng.normal(0, sigma_rad, (9, 3))).as_matrix() @ made.rotations
        if wrong is not None:
            turned[wrong] = Rotation.from_rotvec([0.05, 0, 0]).as_matrix() @ turned[wrong]
        ids = np.arange(9).astype(np.str_)
        made.observed.append(observed_rotations("attitude", np.arange(9), turned, sigma_rad, ids))
    return made


@pytest.mark.slow
def test_attitudes_give_the_rotation_that_positions_on_a_line_leave_open() -> None:
    with pytest.raises(GeometryError, match="rotation about the line"):
        on_a_line(8).oriented(stiff=True)
    found = on_a_line(8, 1e-4).oriented(stiff=True)
    turn = Rotation.from_matrix(found.ground_from_body.rotation @ TRUE.rotation.T).magnitude()
    assert turn < 4 * 1e-4 / np.sqrt(9)
    assert off_m(found.ground_from_body) < 0.3


@pytest.mark.slow
def test_a_wrong_attitude_is_found() -> None:
    found = on_a_line(8, 1e-4, wrong=2).oriented(stiff=True)
    assert active(found, "attitude") == [k != 2 for k in range(9)]


def test_one_known_point_distances_and_attitudes_are_enough() -> None:
    rng = np.random.default_rng(5)
    made = MadeBody(np.concatenate([CORNERS, ENDS]), HIGH, SIGMA_X, SIGMA_X, rng=rng)
    made.control([0], [ALL], SIGMA_GIVEN).distances(START, END, SIGMA_D, rng.normal(0, SIGMA_D, 5))
    turned = Rotation.from_rotvec(rng.normal(0, 1e-4, (2, 3))).as_matrix() @ made.rotations
    made.observed.append(observed_rotations("attitude", np.arange(2), turned, 1e-4, np.array(["1", "2"])))
    found = made.oriented(stiff=True)
    assert abs(found.ground_from_body.scale / TRUE.scale - 1) < 1e-4
    assert off_m(found.ground_from_body) < 0.6


def test_derivatives_of_rotations_are_those_of_differences() -> None:
    made = on_a_line(8, 1e-2)
    ids = np.arange(1, 100).astype(np.str_)
    ties, _ = ties_of(made.body, made.observed, TRUE, "body", ids, ids)
    rows, h = np.arange(9), 1e-6
    for o in (ties[-1], made.observed[-1]):

        def at(turn: np.ndarray, of_body: np.ndarray, o=o) -> tuple[np.ndarray, tuple[np.ndarray, ...]]:
            body = Similarity(TRUE.translation, TRUE.scale, Rotation.from_rotvec(of_body).as_matrix() @ TRUE.rotation)
            off = Rotation.from_rotvec(turn).as_matrix() @ Rotation.from_rotvec([0.02, 0.01, -0.03]).as_matrix()
            poses = Poses(made.images, off @ made.rotations)
            return o.records.evaluate({BODY: similarities_of([body]), POSE: poses}, rows)

        v, jacobians = at(np.zeros(3), np.zeros(3))
        for axis in np.eye(3):
            np.testing.assert_allclose(jacobians[0][:, :, 3:] @ axis, (at(h * axis, np.zeros(3))[0] - v) / h, atol=1e-5)
            if len(jacobians) > 1:
                found = jacobians[1][:, :, 3:6] @ axis
                np.testing.assert_allclose(found, (at(np.zeros(3), h * axis)[0] - v) / h, atol=1e-5)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_wrong_position_is_found_among_few_others(axis: int) -> None:
    rng = np.random.default_rng(4)
    made = MadeBody(np.concatenate([CORNERS, ENDS]), HIGH, SIGMA_X, SIGMA_X, rng=rng)
    error = rng.normal(0, SIGMA_GIVEN, (2, 3))
    error[1, axis] += 2.0
    made.control(range(4), [ALL] * 4, SIGMA_GIVEN, rng.normal(0, SIGMA_GIVEN, (4, 3)))
    found = made.positions(SIGMA_GIVEN, error=error).oriented(stiff=True)
    assert active(found, "position") == [True, False]
    assert active(found, "control") == [True] * 4
    assert off_m(found.ground_from_body) < 0.15


def test_control_that_disagrees_smoothly_is_a_deformation_and_no_gross_error() -> None:
    bend = 4e-7 * ((CORNERS[:, :2] - [1000, 600]) ** 2).sum(axis=1)
    inner = np.concatenate([CORNERS, [[1000.0, 600, 20], [500, 300, 10]]])
    bends = np.append(bend, [0.0, 4e-7 * (500.0**2 + 300.0**2)])
    made = MadeBody(inner, HIGH, SIGMA_X, SIGMA_X, rng=np.random.default_rng(4))
    error = np.column_stack([np.zeros((6, 2)), bends]) + made.rng.normal(0, SIGMA_GIVEN, (6, 3))
    found = made.control(range(6), [ALL] * 6, SIGMA_GIVEN, error).oriented(stiff=True)
    assert all(active(found, "control"))
    assert found.tied.tau_m > 0.05
