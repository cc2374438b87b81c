"""Limits count the tests; room follows redundancy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from aatri.adjustment.statistics.limits import FALSE_ALARM, expected_beyond, limit_of_tests
from aatri.adjustment.statistics.room import redundancy_in_records, room_of


@pytest.mark.parametrize("tests", [1_000, 36_000, 2_300_000])
def test_the_largest_of_all_tests_is_beyond_the_limit_with_the_stated_rate(tests: int) -> None:
    beyond_one = 2 * norm.sf(limit_of_tests(tests))
    assert 1 - (1 - beyond_one) ** tests == pytest.approx(FALSE_ALARM, rel=0.01)


def test_few_tests_keep_four() -> None:
    assert limit_of_tests(0) == limit_of_tests(20) == 4.0
    assert expected_beyond(4.0, 2_300_000) == pytest.approx(145.7, abs=0.1)  # 6.334e-5 of the normal distribution


def test_room_is_half_the_redundancy_three_of_a_small_kind_and_never_more_than_there_is() -> None:
    redundancy, count = np.array([10.4, 3.7, 1.67, 0.0, 12_000.0]), np.array([13, 6, 4, 3, 18_000])
    assert room_of(redundancy, count).tolist() == [5, 3, 1, 0, 6000]
    assert room_of(redundancy, count, 0.05).tolist() == [1, 1, 1, 1, 900]  # a share that is stated obeys


def test_one_may_go_where_tests_know_of_next_to_no_redundancy() -> None:
    """Five points twenty times better than the rays: the wrong one is at 4.7 sigma."""
    assert room_of(np.array([0.14]), np.array([8])).tolist() == [1]


def test_redundancy_in_records_of_points_given_in_part() -> None:
    assert redundancy_in_records(np.array([2.4, 0.5, np.nan]), np.array([3, 1, 2])) == pytest.approx(1.3)
