"""Criteria of layouts against dense computations."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import eigh

from aatri.evaluation.design import criterion_eigenvalue, gains, next_control

SIGMA_M = np.array([0.02, 0.02, 0.05])


def _covariance(seed: int, n: int) -> np.ndarray:
    A = np.random.default_rng(seed).normal(size=(3 * n, 3 * n))
    return (A @ A.T / (3 * n) + 0.1 * np.eye(3 * n)) * 1e-3


@pytest.mark.parametrize("control_sigma_m", [(0.01, 0.01, 0.02), (np.inf, np.inf, 0.02), (0.01, 0.03, np.inf)])
def test_a_gain_is_that_of_an_adjustment_with_the_point_observed(control_sigma_m) -> None:
    n, sigma = 6, np.array(control_sigma_m)
    C = _covariance(1, n)
    A, P = np.zeros((3, 3 * n)), np.diag(1 / sigma**2)
    A[:, 6:9] = np.eye(3)
    after = np.linalg.inv(np.linalg.inv(C) + A.T @ P @ A)
    before, left = (np.diag(M).reshape(n, 3) / SIGMA_M**2 for M in (C, after))
    (gain,) = gains(C.reshape(n, 3, n, 3), SIGMA_M, sigma, np.array([2]))
    assert gain.mean == pytest.approx(1 - left.sum() / before.sum(), rel=1e-10)
    assert gain.worst == pytest.approx(1 - left.max() / before.max(), rel=1e-10)


def test_the_second_control_point_is_the_best_beside_the_first() -> None:
    n, sigma = 7, np.full(3, 0.01)
    C = _covariance(2, n)
    first, second = next_control(C.reshape(n, 3, n, 3), SIGMA_M, sigma, np.arange(n), 2, "mean")
    sums = {}
    for k in range(n):
        A = np.zeros((6, 3 * n))
        A[:3, 3 * first.point : 3 * first.point + 3] = A[3:, 3 * k : 3 * k + 3] = np.eye(3)
        after = np.linalg.inv(np.linalg.inv(C) + A.T @ A / sigma[0] ** 2)
        sums[k] = float((np.diag(after).reshape(n, 3) / SIGMA_M**2).sum())
    del sums[first.point]
    assert second.point == min(sums, key=lambda k: sums[k])


def test_the_criterion_is_the_largest_generalised_eigenvalue() -> None:
    n = 5
    xyz_m, C = np.random.default_rng(3).uniform(0, 500, (n, 3)), _covariance(3, n)
    distance = np.linalg.norm(xyz_m[:, None] - xyz_m, axis=2)
    K = np.kron(0.5 * np.exp(-distance / 200.0) + 0.5 * np.eye(n), np.diag(SIGMA_M**2))
    value, function = criterion_eigenvalue(xyz_m, C.reshape(n, 3, n, 3), SIGMA_M, 200.0)
    assert value == pytest.approx(eigh(C, K, eigvals_only=True)[-1], rel=1e-10)
    f = (function / SIGMA_M).ravel()
    assert f @ C @ f / (f @ K @ f) == pytest.approx(value, rel=1e-8)


def test_a_layout_that_is_the_criterion_has_1_and_two_points_at_one_place_are_no_obstacle() -> None:
    xyz_m = np.array([[0.0, 0, 0], [0, 0, 0], [300, 0, 0]])
    distance = np.linalg.norm(xyz_m[:, None] - xyz_m, axis=2)
    K = np.kron(0.5 * np.exp(-distance / 200.0) + 0.5 * np.eye(3), np.diag(SIGMA_M**2))
    assert criterion_eigenvalue(xyz_m, K.reshape(3, 3, 3, 3), SIGMA_M, 200.0)[0] == pytest.approx(1.0)
