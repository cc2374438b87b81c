"""Two of six control points with each other's number are found; single errors and right points are not."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aatri.errors import GeometryError
from aatri.geometry.rotations import levelling
from aatri.geometry.similarity import Similarity
from aatri.orientation.bodies.exchanged_control import exchanged_by_all, exchanged_control
from aatri.orientation.bodies.free_body import concerning
from tests.orientation.bodies.made_body import ALL, CORNERS, HEIGHT, PLAN, MadeBody, active, off_m


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


GROUND = np.concatenate([CORNERS, [[1000.0, 1100.0, 12.0], [1000.0, 100.0, 25.0]]])


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


def test_a_single_wrong_point_is_no_exchange() -> None:
    given, error = [ALL, ALL, ALL, PLAN, HEIGHT, HEIGHT], np.zeros((6, 3))
    error[1] = [400.0, -300.0, 0.0]
    made = MadeBody(GROUND, off_m=0.02).control(range(6), given, 0.02, error)
    observed, use = concerning(made.observed, made.body), np.ones(6, dtype=bool)
    level = Similarity(np.zeros(3), 1.0, levelling(made.body.up))
    assert not len(exchanged_by_all(observed, lambda _: observed, made.body, use, level))
