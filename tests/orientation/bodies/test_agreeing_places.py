"""Control of which nearly half is wrong: most of it agrees, and the body begins by that."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.geometry.similarity import IDENTITY
from aatri.orientation.bodies.agreeing_places import agreeing_places
from aatri.orientation.bodies.datum_analysis import given_places
from aatri.orientation.bodies.free_body import state_of
from tests.orientation.bodies.made_body import ALL, TRUE, MadeBody, active, off_m

RNG = np.random.default_rng(4)
POINTS = np.column_stack([RNG.uniform(0, 2000, 11), RNG.uniform(0, 1200, 11), RNG.uniform(0, 40, 11)])


def with_rows_off(first: int) -> MadeBody:
    """Control of eleven points whose rows stand one too high from the `first` on, the last of them missing."""
    error = np.roll(POINTS, -1, axis=0) - POINTS
    error[:first] = error[-1] = 0.0
    return MadeBody(POINTS, off_m=0.02).control(range(11), [ALL] * 11, 0.02, error)


@pytest.mark.parametrize("stiff", [True, False])
@pytest.mark.parametrize("first", [9, 7, 5])
def test_rows_that_stand_one_too_high_are_rejected_and_none_else(first: int, stiff: bool) -> None:
    body = with_rows_off(first)
    found = body.oriented(stiff=stiff)
    assert active(found, "control") == [k < first or k == 10 for k in range(11)]
    assert off_m(found.ground_from_body) < 0.2


def agreeing(body: MadeBody, up: np.ndarray | None = None) -> list[bool] | None:
    """Which places of a body agree."""
    places = given_places(body.observed, state_of(body.observed, body.body, IDENTITY))
    result = agreeing_places(places, places.xyz, body.body, up)
    return None if result is None else result.tolist()


@pytest.mark.parametrize("shifted", [0, 5, 6])
def test_of_two_halves_none_is_chosen_and_what_fits_is_left_alone(shifted: int) -> None:
    """Ten points of two surveys: five and five tell nothing, six outvote four."""
    error = np.zeros((10, 3))
    error[:shifted] = [120.0, -80.0, 0.0]
    body = MadeBody(POINTS[:10], off_m=0.02).control(range(10), [ALL] * 10, 0.02, error)
    expected = [k < shifted for k in range(10)] if shifted == 6 else None
    assert agreeing(body) == expected


def test_what_bends_is_no_wrong_control() -> None:
    """Errors that grow along the body, to 4 % of the distance, leave some in between."""
    along = (POINTS[:, 0] / 2000.0) ** 2
    body = MadeBody(POINTS, off_m=0.02).control(range(11), [ALL] * 11, 0.02, np.outer(along, [0.0, 0.0, 60.0]))
    assert agreeing(body) is None


@pytest.mark.parametrize("off_z_m", [0.0, 500.0])
def test_positions_of_the_images_agree_with_the_control_that_is_right_or_tell_another_story(off_z_m: float) -> None:
    """Six of ten control points are right; where a position is off too it is left to the tests of positions."""
    error = np.zeros((10, 3))
    error[:4] = [120.0, -80.0, 0.0]
    images = np.array([[900.0, 500.0, 1500.0], [1100.0, 700.0, 1500.0], [1000.0, 200.0, 1500.0]])
    body = MadeBody(POINTS[:10], images, off_m=0.02).control(range(10), [ALL] * 10, 0.02, error)
    body.positions(0.02, error=np.array([[0.0, 0.0, off_z_m], [0.0] * 3, [0.0] * 3]))
    expected = [False] * 4 + [True] * 6 + [True] * 3
    assert agreeing(body) == (None if off_z_m else expected)


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_places_that_agree_only_where_images_look_upwards_do_not_agree(sense: float) -> None:
    """The same six of ten; `up` is the direction against the view in the body, or with it."""
    error = np.zeros((10, 3))
    error[:4] = [120.0, -80.0, 0.0]
    body = MadeBody(POINTS[:10], off_m=0.02).control(range(10), [ALL] * 10, 0.02, error)
    up = sense * TRUE.rotation.T @ np.array([0.0, 0.0, 1.0])
    assert agreeing(body, up) == ([False] * 4 + [True] * 6 if sense > 0 else None)


def test_of_more_places_than_all_triples_are_tried_of_random_ones_find_those_that_agree() -> None:
    """Thirty points have 4060 triples; sixteen of them are right."""
    rng = np.random.default_rng(7)
    points = rng.uniform(0, [2000.0, 1200.0, 40.0], (30, 3))
    error = rng.normal(0.0, 300.0, (30, 3))
    is_right = np.arange(30) % 2 == 0
    is_right[1] = True
    error[is_right] = 0.0
    body = MadeBody(points, off_m=0.02).control(range(30), [ALL] * 30, 0.02, error)
    assert agreeing(body) == is_right.tolist()
