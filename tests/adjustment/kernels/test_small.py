"""Small dense normal equations, compiled, against NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.adjustment.kernels.small import inverse, inverse_root, leverage, median, newton_step, select


def _normal(rng: np.random.Generator, u: int, scales: float = 3.0) -> tuple[np.ndarray, np.ndarray]:
    J = rng.normal(size=(40, u)) * 10.0 ** rng.uniform(-scales, scales, u)
    return J, J.T @ J


@pytest.mark.parametrize("u", [1, 3, 5, 6, 11])
def test_solution_covariance_and_condition_are_those_of_dense_algebra(u: int) -> None:
    rng = np.random.default_rng(u)
    J, N = _normal(rng, u)
    W, Q, dx, g = np.empty((u, u)), np.empty((u, u)), np.empty(u), J.T @ rng.normal(size=40)
    bound = inverse_root(np.tril(N) + np.triu(np.full((u, u), np.nan), 1), W)  # only the lower triangle is read
    root = np.sqrt(np.diag(N))
    lowest = np.linalg.eigvalsh(N / np.outer(root, root))[0]
    assert lowest / u - 1e-12 <= bound <= lowest + 1e-12
    decrement = newton_step(W, g, dx)
    expected = -np.linalg.lstsq(J / root, np.linalg.lstsq((J / root).T, g / root, rcond=None)[0], rcond=None)[0] / root
    np.testing.assert_allclose(dx * root, expected * root, atol=1e-12 * np.abs(expected * root).max())
    assert decrement == pytest.approx(np.linalg.norm(J @ expected), rel=1e-12)
    inverse(W, Q)
    np.testing.assert_allclose(Q * np.outer(root, root), np.linalg.inv(N / np.outer(root, root)), atol=1e-12)
    assert leverage(W, J[7]) == pytest.approx(J[7] @ Q @ J[7], rel=1e-12)


def test_what_is_open_or_not_finite_has_no_positive_bound() -> None:
    W = np.empty((3, 3))
    J = np.random.default_rng(1).normal(size=(9, 3))
    J[:, 2] = J[:, 0] - 2 * J[:, 1]
    assert not inverse_root(J.T @ J, W) > 1e-12
    assert not inverse_root(np.zeros((3, 3)), W) > 0
    for bad in (np.nan, np.inf, -1.0):
        N = np.eye(3)
        N[1, 1] = bad
        assert not inverse_root(N, W) > 0 or bad == np.inf
        N = np.eye(3)
        N[2, 1] = bad
        assert not inverse_root(N, W) > 0


def test_the_kth_smallest_and_the_median_are_those_of_numpy() -> None:
    rng = np.random.default_rng(2)
    for n in [1, 2, 3, 4, 7, 10, 101, 256]:
        for values in (rng.normal(size=n), rng.integers(0, 3, n).astype(float), np.zeros(n), np.arange(n) * 1.0):
            k = int(rng.integers(n))
            assert select(np.append(values, -9.0), n, k) == np.sort(values)[k]
            assert median(np.append(values, -9.0), n) == np.median(values)
