"""Tests of parameters against closed forms, simulation and constrained solutions."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import integrate, stats

from aatri.adjustment.statistics.removal import held_at_zero, propose_removal, size_of_idle, stepwise_removal
from aatri.adjustment.statistics.significance import (
    correlated_pairs,
    correlated_with_others,
    estimates,
    joint_test,
    parameter_tests,
)

NAMES = ("a", "b", "c", "d")


def _linear_problem(seed: int = 1, n: int = 60) -> tuple[Any, Any]:
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, 4))
    return A, rng.normal(size=n)


def _solved(A: Any, l: Any, prior: Any = None) -> Any:  # noqa: E741
    P0 = np.zeros(A.shape[1]) if prior is None else 1.0 / prior**2
    C = np.linalg.inv(A.T @ A + np.diag(P0))
    return estimates(NAMES[: A.shape[1]], C @ A.T @ l, C, prior)


def test_t_of_a_mean() -> None:
    # nine observations of sigma 3, mean 2: sigma of the mean 1, t = 2, two-sided p of the normal distribution 0.0455
    tests = parameter_tests(estimates(["m"], np.array([2.0]), np.array([[1.0]])))
    assert tests.t[0] == pytest.approx(2.0)
    assert tests.p_value[0] == pytest.approx(0.0455, abs=5e-5)
    assert tests.significant[0]
    assert tests.data_share[0] == 1.0
    # with 9 degrees of freedom Student's 5 % limit is 2.262
    tests = parameter_tests(estimates(["m"], np.array([2.0]), np.array([[1.0]]), redundancy=9))
    assert not tests.significant[0]


def test_sigma0_scales_standard_deviations_and_tests() -> None:
    tests = parameter_tests(estimates(["m"], np.array([2.0]), np.array([[1.0]]), sigma0=2.0, redundancy=20))
    assert tests.sigma[0] == 2.0
    assert tests.t[0] == pytest.approx(1.0)


def test_a_prior_does_not_dilute_the_test() -> None:
    # data: 2 +- 1, prior 0 +- 1: estimate 1, half of it from the data; the data alone have t = 2
    tests = parameter_tests(estimates(["m"], np.array([1.0]), np.array([[0.5]]), np.array([1.0])))
    assert tests.data_share[0] == pytest.approx(0.5)
    assert tests.t[0] == pytest.approx(2.0)


def test_what_only_the_prior_says_is_not_tested() -> None:
    tests = parameter_tests(estimates(["m"], np.array([0.0]), np.array([[0.95]]), np.array([1.0])))
    assert tests.data_share[0] == pytest.approx(0.05)
    assert np.isnan(tests.t[0])
    assert not tests.significant[0]


@pytest.mark.parametrize("prior", [None, np.array([0.1, 0.2, 0.15, 1e9])], ids=["free", "weighted"])
def test_false_alarms_are_as_frequent_as_alpha_says(prior: Any) -> None:
    rng = np.random.default_rng(2)
    A = rng.normal(size=(60, 4)) @ np.array([[1, 0.6, 0, 0], [0, 1, 0.5, 0], [0, 0, 1, 0.3], [0, 0, 0, 1.0]])
    single, joint = [], []
    for _ in range(300):
        e = _solved(A, rng.normal(size=60), prior)
        single.append(parameter_tests(e).p_value)
        joint.append(joint_test(e).p_value)
    for p_values in [*np.array(single).T, np.array(joint)]:
        assert stats.kstest(p_values, "uniform").pvalue > 1e-3


def test_joint_test_is_the_loss_of_fit() -> None:
    # p' C^-1 p is the rise of the sum of squares when the parameters are left out
    A, l = _linear_problem()  # noqa: E741
    e = _solved(A, l + A @ [0.3, 0, 0, 0.2])
    l = l + A @ [0.3, 0, 0, 0.2]  # noqa: E741
    rest = np.linalg.lstsq(A, l, rcond=None)[1][0]
    without = np.linalg.lstsq(A[:, 1:3], l, rcond=None)[1][0]
    two = np.array([0, 3])
    found = joint_test(estimates(("a", "d"), e.values[two], e.covariance[np.ix_(two, two)]))
    assert found.parameters == 2
    assert found.statistic * 2 == pytest.approx(without - rest, rel=1e-10)
    assert found.p_value == pytest.approx(stats.chi2.sf(without - rest, 2), rel=1e-9)


def test_holding_a_parameter_at_zero_is_the_solution_without_it() -> None:
    A, l = _linear_problem()  # noqa: E741
    prior = np.array([0.5, 1.0, 2.0, 3.0])
    found = held_at_zero(_solved(A, l, prior), "b")
    keep = [0, 2, 3]
    wanted = _solved(A[:, keep], l, prior[keep])
    assert found.names == ("a", "c", "d")
    assert found.values == pytest.approx(wanted.values, rel=1e-12)
    assert found.covariance == pytest.approx(wanted.covariance, rel=1e-12)


def test_correlated_pairs() -> None:
    # b = a + 0.1 noise, c independent: correlation of the estimates of a and b near -1
    rng = np.random.default_rng(3)
    a, noise, c = rng.normal(size=(3, 5000))
    e = _solved(np.stack([a, a + 0.1 * noise, c], axis=1), np.zeros(5000))
    pairs = correlated_pairs(e, 0.9)
    assert [(p.first, p.second) for p in pairs] == [("a", "b")]
    assert pairs[0].correlation == pytest.approx(-1 / np.sqrt(1.01), abs=2e-3)


def test_correlation_with_unknowns_outside_the_group() -> None:
    joint = np.array([[4.0, 1.9, 0.0], [1.9, 1.0, 0.0], [0.0, 0.0, 1.0]])
    e = estimates(["c"], np.zeros(1), joint[:1, :1])
    pairs = correlated_with_others(e, joint[:1, 1:], np.diag(joint)[1:], ["Z0 of image 7", "Z0 of image 8"], 0.9)
    assert [(p.first, p.second) for p in pairs] == [("c", "Z0 of image 7")]
    assert pairs[0].correlation == pytest.approx(0.95)


def test_the_idle_parameters_are_removed_and_the_real_ones_kept() -> None:
    rng = np.random.default_rng(4)
    A = rng.normal(size=(400, 4))
    l = A @ [0.5, 0.0, 0.4, 0.0] + rng.normal(size=400)  # noqa: E741
    left, removals = stepwise_removal(_solved(A, l), alpha=0.01)
    assert left.names == ("a", "c")
    assert all("not significant" in r.reason for r in removals)
    wanted = _solved(A[:, [0, 2]], l)
    assert left.values == pytest.approx(wanted.values, rel=1e-10)


def test_one_of_two_that_hide_each_other_stays() -> None:
    # neither is significant beside the other, one alone is
    rng = np.random.default_rng(5)
    a = rng.normal(size=300)
    A = np.stack([a, a + 0.02 * rng.normal(size=300)], axis=1)
    e = _solved(A, A @ [0.5, 0.0] + rng.normal(size=300))
    assert not parameter_tests(e).significant.any()
    assert propose_removal(e) is not None
    assert "cannot be told from" in propose_removal(e).reason  # type: ignore[union-attr]
    left, removals = stepwise_removal(e)
    assert len(removals) == 1
    assert parameter_tests(left).significant.all()


def test_undetermined_parameters_go_first() -> None:
    C = np.diag([1.0, np.nan, 1.0])
    e = estimates(["a", "b", "c"], np.array([9.0, np.nan, 0.1]), C)
    first = propose_removal(e)
    assert first is not None
    assert (first.name, first.reason) == ("b", "not determined")
    left, removals = stepwise_removal(e)
    assert left.names == ("a",)
    assert [r.name for r in removals] == ["b", "c"]
    assert left.values == pytest.approx([9.0])


@pytest.mark.parametrize(
    ("values", "covariance", "prior"),
    [((3,), (2, 2), (2,)), ((2,), (3, 3), (2,)), ((2,), (2, 3), (2,)), ((2,), (2, 2), (3,))],
)
def test_estimates_of_other_shapes_are_refused(values, covariance, prior) -> None:
    with pytest.raises(ValueError, match="2 names"):
        estimates(("a", "b"), np.ones(values), np.ones(covariance), np.ones(prior))


@pytest.mark.parametrize(("chi_square", "count"), [(0.3, 1), (7.0, 9), (30.0, 9), (500.0, 600)])
def test_the_size_of_idle_parameters_is_that_of_a_truncated_gamma_distribution(chi_square: float, count: int) -> None:
    """1 - w has the density u^(count / 2) exp(-chi_square u / 2) between 0 and 1."""
    norm, first, second = (
        integrate.quad(lambda u, k=k: u ** (count / 2 + k) * np.exp(-chi_square * (u - 1) / 2), 0, 1, limit=200)[0]
        for k in (0, 1, 2)
    )
    share, square = size_of_idle(chi_square, count)
    assert share == pytest.approx(1 - first / norm, abs=1e-6)
    assert square == pytest.approx(1 - 2 * first / norm + second / norm, abs=1e-6)


def test_idle_parameters_larger_than_chance_makes_them_count_more() -> None:
    shares = [size_of_idle(chi_square, 8)[0] for chi_square in (0.0, 4.0, 8.0, 16.0, 32.0)]
    assert shares == sorted(shares)
    assert shares[0] == pytest.approx(1 / 6, abs=1e-6)  # 1 - E(u) of u^4: 5 / 6
    assert shares[-1] > 0.65
