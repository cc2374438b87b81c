"""Data snooping: its rules and its limits."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from aatri.adjustment.statistics.limits import FALSE_ALARM, expected_beyond, limit_of_tests
from aatri.adjustment.statistics.rejection import redundancy_in_records, room_of
from aatri.errors import ConvergenceError, GeometryError
from tests.adjustment.dense import DenseResult, adjust
from tests.adjustment.statistics.snooping import SnoopedResult, snoop, statistics

# Data snooping: detection, size, re-admission, calibration.


def _problem(seed: int, n: int = 30, errors: dict[int, float] | None = None):
    rng = np.random.default_rng(seed)
    A = np.column_stack([np.ones(n), rng.uniform(-1, 1, (n, 2))])
    y = A @ [1.0, 2.0, 3.0] + rng.normal(size=n)
    for row, size in (errors or {}).items():
        y[row] += size
    return A, y


def _snoop(A: np.ndarray, y: np.ndarray, active: np.ndarray | None = None, limit: float = 4.0) -> SnoopedResult:
    def solve(use: np.ndarray, start: np.ndarray) -> DenseResult:
        return adjust(lambda s: (A[use] @ s - y[use], A[use]), lambda s, d: s + d, start)

    return snoop(
        solve, lambda s: ((A @ s - y)[:, None], A[:, None, :]), np.zeros(3), len(y), limit=limit, active=active
    )


def test_gross_errors_are_found_and_sized() -> None:
    result = _snoop(*_problem(4, errors={7: 40.0, 21: -25.0}))
    assert set(np.flatnonzero(~result.active)) == {7, 21}
    np.testing.assert_allclose(result.size[[7, 21], 0], [40.0, -25.0], atol=4.0)


def test_a_good_record_rejected_before_is_readmitted() -> None:
    A, y = _problem(5)
    active = np.ones(30, dtype=bool)
    active[3] = False
    assert _snoop(A, y, active).active.all()


def test_an_uncontrolled_record_is_not_tested() -> None:
    A = np.vstack([np.column_stack([np.ones(6), np.zeros(6)]), [[0.0, 1.0]]])
    y = np.array([0.1, -0.1, 0.2, 0.0, -0.2, 0.0, 99.0])
    result = adjust(lambda s: (A @ s - y, A), lambda s, d: s + d, np.zeros(2))
    _, test = statistics(lambda s: ((A @ s - y)[:, None], A[:, None, :]), result, np.ones(7, dtype=bool))
    assert np.isnan(test[6])
    assert np.isfinite(test[:6]).all()


def test_without_gross_errors_the_statistic_is_standard_normal() -> None:
    tests = []
    for seed in range(300):
        A, y = _problem(1000 + seed)
        result = adjust(lambda s, A=A, y=y: (A @ s - y, A), lambda s, d: s + d, np.zeros(3))
        tests.append(
            statistics(lambda s, A=A, y=y: ((A @ s - y)[:, None], A[:, None, :]), result, np.ones(30, dtype=bool))[1]
        )
    w2 = np.concatenate(tests) ** 2
    # 9,000 values of mean 1, variance 2: 3.3 sigma of the mean is 0.05
    assert w2.mean() == pytest.approx(1.0, abs=0.05)


# Data snooping worked out by hand: which record goes first, just inside and just outside each limit.
#
# The mean of n values of standard deviation 1 has the variance 1/n. One value off by e among zeros has the residual
# -(1 - 1/n) e, the redundancy number 1 - 1/n and so the test e sqrt(1 - 1/n); left out, its prediction is wrong by e,
# and the test of that is e / sqrt(1 + 1/(n - 1)), the same figure.


def snooped(A: np.ndarray, y: np.ndarray, *, fewest: int = 0, **options: object) -> SnoopedResult:
    """Snooping of y = A x; below `fewest` records it cannot be solved."""

    def solve(use: np.ndarray, start: np.ndarray) -> DenseResult:
        if use.sum() < fewest:
            raise GeometryError("too few")
        return adjust(lambda s: (A[use] @ s - y[use], A[use]), lambda s, d: s + d, start)

    return snoop(solve, lambda s: ((A @ s - y)[:, None], A[:, None, :]), np.zeros(A.shape[1]), len(y), **options)


def mean_of(errors: dict[int, float], n: int = 5, **options: object) -> SnoopedResult:
    y = np.zeros(n)
    y[list(errors)] = list(errors.values())
    return snooped(np.ones((n, 1)), y, **options)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_record_is_rejected_just_beyond_the_limit(sign: int) -> None:
    edge = 4.0 / np.sqrt(0.8)
    inside, outside = mean_of({2: sign * (edge - 0.01)}), mean_of({2: sign * (edge + 0.01)})
    assert inside.active.all()
    assert inside.test[2] == pytest.approx((edge - 0.01) * np.sqrt(0.8))
    assert inside.size[2, 0] == pytest.approx(sign * (edge - 0.01))  # observed minus what it should be
    assert np.flatnonzero(~outside.active).tolist() == [2]
    assert outside.size[2, 0] == pytest.approx(sign * (edge + 0.01))
    assert outside.test[2] == pytest.approx((edge + 0.01) / np.sqrt(1.25))
    assert outside.result.state[0] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_rejected_record_returns_just_within_the_limit(sign: int) -> None:
    edge = 4.0 * np.sqrt(1.25)
    without = np.arange(5) != 2
    assert mean_of({2: sign * (edge - 0.01)}, active=without).active.all()
    assert np.flatnonzero(~mean_of({2: sign * (edge + 0.01)}, active=without).active).tolist() == [2]


def test_the_largest_test_goes_first_and_not_the_largest_residual() -> None:
    """An error at the end of a line moves the line: the largest residual is that of its neighbour."""
    x = np.array([0.0, 1.0, 2.0, 3.0, 10.0, 12.0])
    A = np.column_stack([np.ones(6), x])
    y = np.where(x == 12.0, 30.0, 0.0)
    r = 1.0 - np.diag(A @ np.linalg.inv(A.T @ A) @ A.T)
    v = A @ np.linalg.lstsq(A, y)[0] - y
    assert np.argmax(np.abs(v)) == 4  # not the wrong one
    assert np.argmax(np.abs(v) / np.sqrt(r)) == 5
    found = snooped(A, y, max_share=0.17)
    assert np.flatnonzero(~found.active).tolist() == [5]
    assert found.size[5, 0] == pytest.approx(30.0)


def test_one_goes_at_a_time_and_the_rest_is_tested_anew() -> None:
    """One error of 100 among ten makes the others look wrong by 10 each; without it they are right."""
    found = mean_of({4: 100.0}, n=10)
    assert np.flatnonzero(~found.active).tolist() == [4]
    found = mean_of({4: 100.0, 7: -60.0, 1: 20.0}, n=20)
    assert np.flatnonzero(~found.active).tolist() == [1, 4, 7]


@pytest.mark.parametrize(("share", "gone"), [(0.1, [4]), (0.2, [4, 7]), (0.19, [4, 7]), (0.3, [1, 4, 7])])
def test_no_more_than_the_share_is_rejected_and_the_worst_of_it(share: float, gone: list[int]) -> None:
    found = mean_of({4: 100.0, 7: -60.0, 1: 30.0}, n=10, max_share=share)
    assert np.flatnonzero(~found.active).tolist() == gone


def test_what_began_rejected_counts_in_the_share() -> None:
    active = np.arange(10) != 0
    found = mean_of({0: 50.0, 4: 100.0, 7: -60.0}, n=10, max_share=0.2, active=active)
    assert np.flatnonzero(~found.active).tolist() == [0, 4]


def test_nothing_returns_while_something_is_still_to_go() -> None:
    """Record 0 fits only because record 4 has drawn the mean; without 4 it does not."""
    active = np.arange(6) != 0
    found = mean_of({0: 8.0, 4: 40.0}, n=6, active=active, max_share=0.5)
    assert np.flatnonzero(~found.active).tolist() == [0, 4]


def test_the_best_fitting_returns_first() -> None:
    """Values 0 and 4.3 were left out: 4.3 fits the mean of the others, at 2, until 0 has come back."""
    y = np.array([2.0, 2.0, 2.0, 0.5, 4.3])
    A = np.ones((5, 1))
    active = np.array([True, True, True, False, False])
    alone = 4.3 - 2.0
    after = 4.3 - (3 * 2.0 + 0.5) / 4
    limit = 0.5 * (alone / np.sqrt(1 + 1 / 3) + after / np.sqrt(1 + 1 / 4))
    found = snooped(A, y, active=active, limit=float(limit))
    assert found.active.tolist() == [True, True, True, True, False]


def test_a_record_without_which_nothing_can_be_solved_stays() -> None:
    found = mean_of({2: 50.0}, fewest=5)
    assert found.active.all()
    assert found.test[2] == pytest.approx(50.0 * np.sqrt(0.8))


def test_a_record_of_two_residuals_is_tested_as_a_whole() -> None:
    """A mean point of n points: w = sqrt(v' R^-1 v / 2) with R = (1 - 1/n) I."""
    n, e = 5, np.array([6.0, -3.0])
    y = np.zeros((n, 2))
    y[3] = e
    J = np.tile(np.eye(2), (n, 1, 1))

    def solve(use: np.ndarray, start: np.ndarray) -> DenseResult:
        return adjust(lambda s: ((s - y[use]).ravel(), J[use].reshape(-1, 2)), lambda s, d: s + d, start)

    result = solve(np.ones(n, dtype=bool), np.zeros(2))
    size, test = statistics(lambda s: (s - y, J), result, np.ones(n, dtype=bool))
    np.testing.assert_allclose(size[3], e)
    assert test[3] == pytest.approx(np.sqrt(0.8 * (e @ e) / 2))
    without = np.arange(n) != 3
    size, test = statistics(lambda s: (s - y, J), solve(without, np.zeros(2)), without)
    np.testing.assert_allclose(size[3], e)
    assert test[3] == pytest.approx(np.sqrt((e @ e) / 1.25 / 2))
    found = snoop(solve, lambda s: (s - y, J), np.zeros(2), n, limit=float(test[3]) - 0.01)
    assert np.flatnonzero(~found.active).tolist() == [3]


def test_an_uncontrolled_record_is_never_rejected() -> None:
    A = np.vstack([np.column_stack([np.ones(6), np.zeros(6)]), [[0.0, 1.0]]])
    y = np.array([0.0, 0.0, 30.0, 0.0, 0.0, 0.0, 99.0])
    found = snooped(A, y)
    assert np.flatnonzero(~found.active).tolist() == [2]
    assert np.isnan(found.test[6])
    assert found.result.state[1] == pytest.approx(99.0)


# Residuals and derivatives that are no numbers


@pytest.mark.parametrize("which", ["v", "J"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_start_that_cannot_be_evaluated_is_refused(which: str, value: float) -> None:
    def linearise(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        v, J = np.array([x[0], 0.0]), np.array([[1.0], [0.0]])
        (v if which == "v" else J)[1] = value
        return v, J

    with pytest.raises(ConvergenceError, match="not finite at the start"):
        adjust(linearise, lambda x, d: x + d, np.array([1.0]))


@pytest.mark.parametrize("which", ["v", "J"])
def test_a_step_to_where_nothing_can_be_evaluated_is_shortened(which: str) -> None:
    """arctan(x) from x = 1.2: the first step leads to x = -0.94, which is no place to be here."""

    def linearise(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        v, J = np.arctan(x), (1.0 / (1.0 + x**2))[:, None]
        if x[0] < -0.5:
            (v if which == "v" else J)[:] = np.nan
        return np.append(v, 0.0), np.vstack([J, [[0.0]]])

    assert 1.2 - np.arctan(1.2) * (1 + 1.2**2) < -0.5
    found = adjust(linearise, lambda x, d: x + d, np.array([1.2]))
    assert found.state[0] == pytest.approx(0.0, abs=1e-6)


# Limits count the tests; room follows redundancy.


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
