"""Exchanged numbers at a start: the two are named, errors that points share or have alone are not taken for it."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.adjustment.statistics.exchanged import exchanged_at_start

SQUARE = np.array([[0.0, 0, 0], [100, 0, 2], [0, 100, 5], [100, 100, 1], [50, 50, 3]])


def _exchanged(given: np.ndarray, first: int, second: int) -> np.ndarray:
    out = given.copy()
    out[[first, second]] = out[[second, first]]
    return out


@pytest.mark.parametrize(("n", "first", "second"), [(4, 0, 1), (4, 0, 3), (5, 0, 1), (5, 0, 3), (5, 2, 4)])
def test_two_exchanged_points_are_found_from_an_approximate_start(n: int, first: int, second: int) -> None:
    start = SQUARE[:n] + np.random.default_rng(3).normal(0, 2.0, (n, 3)) + [3.0, 1.0, -2.0]
    (pair,) = exchanged_at_start(start, _exchanged(SQUARE[:n], first, second))
    assert (pair.first, pair.second) == (first, second)
    assert pair.as_given_m == pytest.approx(np.linalg.norm(SQUARE[first] - SQUARE[second]), rel=0.1)
    assert pair.exchanged_m < 15


def test_heights_alone_tell_it_too() -> None:
    heights = np.where([False, False, True], SQUARE * [1, 1, 20], np.nan)
    (pair,) = exchanged_at_start(SQUARE * [1, 1, 20], _exchanged(heights, 1, 2))
    assert (pair.first, pair.second) == (1, 2)


@pytest.mark.parametrize(
    "start",
    [
        SQUARE,
        SQUARE + np.array([500.0, -300, 20]),  # another datum: all are off alike
        SQUARE @ np.diag([-1.0, -1, 1]) + [100, 100, 0],  # turned by 180 degrees: all pairs change places
        SQUARE + np.array([[80.0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0], [0, -60, 0]]),  # two single blunders
        SQUARE[[1, 2, 0, 3, 4]],  # three in a ring
        np.full((5, 3), np.nan),
    ],
)
def test_other_errors_are_no_exchange(start: np.ndarray) -> None:
    assert exchanged_at_start(start, SQUARE) == []


def test_of_two_points_alone_nothing_is_said() -> None:
    assert exchanged_at_start(SQUARE[:2], _exchanged(SQUARE[:2], 0, 1)) == []


def test_many_points_off_are_no_matter_of_two_numbers_and_take_no_time() -> None:
    found = np.random.default_rng(1).uniform(0, 1000, (3000, 3))
    assert exchanged_at_start(found, found[::-1]) == []
