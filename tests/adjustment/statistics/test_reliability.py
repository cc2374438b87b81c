"""Reliability: identities, and calibration by simulation."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.adjustment.statistics.limits import DELTA0
from aatri.adjustment.statistics.reliability import independent_reliability, moved, reliability


def test_independent_components_follow_the_textbook() -> None:
    sigma, r, v = np.array([[2.0, 3.0]]), np.array([[0.25, 0.81]]), np.array([[1.0, -2.0]])
    S = np.einsum("ni,ij->nij", sigma**2, np.eye(2))
    found = reliability(v, S, S * (1 - r)[:, :, None])
    np.testing.assert_allclose(found.redundancy, r)
    np.testing.assert_allclose(found.test, v / (sigma * np.sqrt(r)))
    np.testing.assert_allclose(found.detectable, DELTA0 * sigma / np.sqrt(r))
    np.testing.assert_allclose(found.external, DELTA0 * np.sqrt((1 - r) / r))


def test_what_nothing_controls_has_no_test() -> None:
    found = reliability(np.zeros((1, 2)), np.eye(2)[None], np.diag([1.0, 0.5])[None])
    assert found.redundancy[0].tolist() == [0.0, 0.5]
    assert np.isnan(found.test[0, 0])
    assert np.isnan(found.detectable[0, 0])


@pytest.mark.slow
def test_statistics_are_standard_normal_and_errors_of_the_detectable_size_are_found_with_80_percent() -> None:
    rng = np.random.default_rng(8)
    A = rng.normal(size=(30, 5))
    half = rng.normal(size=(10, 3, 3))
    S = half @ half.swapaxes(1, 2) + 0.5 * np.eye(3)
    L = np.linalg.cholesky(S)
    W = np.zeros((30, 30))
    for k in range(10):
        W[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = np.linalg.inv(S[k])
    Q = np.linalg.inv(A.T @ W @ A)
    hat = A @ Q @ A.T
    adjusted = np.stack([hat[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] for k in range(10)])
    residuals_of = A @ Q @ A.T @ W - np.eye(30)

    def tests(errors: np.ndarray) -> np.ndarray:
        return reliability((residuals_of @ errors).reshape(10, 3), S, adjusted).test

    noise = np.einsum("kij,nkj->nki", L, rng.normal(size=(4000, 10, 3))).reshape(-1, 30)
    w = np.stack([tests(e) for e in noise])
    # 120,000 values, correlated within a run: the mean square within 3 %
    assert (w**2).mean() == pytest.approx(1.0, abs=0.03)
    size = reliability(np.zeros((10, 3)), S, adjusted).detectable[4, 1]
    found = [abs(tests(e + size * np.eye(30)[13])[4, 1]) > 3.29 for e in noise]
    assert np.mean(found) == pytest.approx(0.80, abs=0.02)


def _correlated(rng: np.random.Generator):
    """30 observations of 5 unknowns in records of 3 that are correlated: A, covariances, whole weight, Q, J Q J'."""
    A = rng.normal(size=(30, 5))
    half = rng.normal(size=(10, 3, 3))
    S = half @ half.swapaxes(1, 2) + 0.1 * np.eye(3)
    W = np.zeros((30, 30))
    for k in range(10):
        W[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = np.linalg.inv(S[k])
    Q = np.linalg.inv(A.T @ W @ A)
    hat = A @ Q @ A.T
    return A, S, W, Q, np.stack([hat[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] for k in range(10)])


def test_redundancy_numbers_of_correlated_observations_sum_to_the_redundancy() -> None:
    """Single ones may be negative or beyond one: they are not clipped."""
    outside = 0
    for seed in range(20):
        _, S, _, _, adjusted = _correlated(np.random.default_rng(seed))
        r = reliability(np.zeros((10, 3)), S, adjusted).redundancy
        assert r.sum() == pytest.approx(25.0, abs=1e-10)
        outside += int(((r < 0) | (r > 1)).sum())
    assert outside > 0


def test_external_reliability_is_what_a_detectable_error_does_to_all_unknowns_together() -> None:
    A, S, W, Q, adjusted = _correlated(np.random.default_rng(3))
    found = reliability(np.zeros((10, 3)), S, adjusted)
    for i in range(30):
        size = found.detectable.ravel()[i]
        dx = Q @ A.T @ W @ (size * np.eye(30)[i])
        assert found.external.ravel()[i] == pytest.approx(np.sqrt(dx @ np.linalg.solve(Q, dx)), rel=1e-9)
        # no function of the unknowns is moved by more of its standard deviations
        for f in np.random.default_rng(i).normal(size=(20, 5)):
            assert abs(f @ dx) <= found.external.ravel()[i] * np.sqrt(f @ Q @ f) * (1 + 1e-9)


def test_blocks_are_moved_by_what_an_adjustment_with_the_error_moves_them() -> None:
    A, S, W, Q, adjusted = _correlated(np.random.default_rng(4))
    found = reliability(np.zeros((10, 3)), S, adjusted)
    L = np.linalg.inv(np.linalg.cholesky(S))
    K = np.stack([(Q @ A[3 * k : 3 * k + 3].T @ L[k].T)[1:4] for k in range(10)])
    lengths = moved(K, L, found.detectable, slice(0, 2))
    for k in range(10):
        for i in range(3):
            error = np.zeros(30)
            error[3 * k + i] = found.detectable[k, i]
            assert lengths[k, i] == pytest.approx(np.linalg.norm((Q @ A.T @ W @ error)[1:3]), rel=1e-9)


def test_records_of_independent_components_take_a_short_way_to_the_same_figures() -> None:
    rng = np.random.default_rng(5)
    L, v = rng.uniform(0.5, 2.0, (6, 2)), rng.normal(size=(6, 2))
    half = 0.4 * rng.normal(size=(6, 2, 2))
    R = half @ half.swapaxes(1, 2)
    R[0, 0, 0], R[1] = 1.0, np.nan
    back = (1.0 / L)[:, :, None] * np.eye(2)
    wanted = reliability(v, back @ back, back @ R @ back)
    found = independent_reliability(v, L, R)
    for name in ("redundancy", "test", "detectable", "external"):
        np.testing.assert_allclose(getattr(found, name), getattr(wanted, name), rtol=1e-12)
