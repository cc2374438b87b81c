"""Control of which nearly half is wrong: most of it agrees, and the body begins by that."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.geometry.similarity import IDENTITY
from aatri.orientation.bodies.agreeing_places import agreeing_places
from aatri.orientation.bodies.datum_analysis import given_places
from aatri.orientation.bodies.free_body import state_of
from tests.orientation.bodies.made_body import ALL, MadeBody, active, off_m

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


def agreeing(body: MadeBody) -> list[bool] | None:
    """Which places of a body agree."""
    places = given_places(body.observed, state_of(body.observed, body.body, IDENTITY))
    result = agreeing_places(places, places.xyz, body.body, None)
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
