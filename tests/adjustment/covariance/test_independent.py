"""Independent errors against the dense covariance."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.adjustment.covariance import independent
from aatri.adjustment.covariance.independent import independent_errors, independent_predictions
from aatri.adjustment.stepping.adjust import adjust_large
from tests.adjustment.block_problem import made_problem
from tests.adjustment.reference import dense_jacobian, free_columns


def _dense(seed: int):
    unknowns, records, start = made_problem(seed, n_kept=14, n_points=40)
    result = adjust_large(unknowns, records, start)
    J, _ = dense_jacobian(unknowns, records, result.state)
    return result, np.pad(np.linalg.inv(J.T @ J), (0, 1)), free_columns(unknowns)


def _expected(Q: np.ndarray, columns: np.ndarray, rows: np.ndarray, others: np.ndarray) -> float:
    C = Q[np.ix_(columns[rows], columns[rows])] + np.diag(others[rows])
    return float(np.trace(C) ** 2 / np.trace(C @ C))


@pytest.mark.parametrize("group", ["a", "p"])
def test_it_is_the_square_of_the_trace_over_the_trace_of_the_square(group: str) -> None:
    result, Q, columns = _dense(4)
    of = columns[group]
    n, k = of.shape
    members = np.random.default_rng(1).random((n, k)) < 0.6
    others = np.random.default_rng(2).random((n, k))
    variance = np.array([[Q[c, c] for c in row] for row in of])
    found = independent_errors(result, group, members, variance, others)
    for scalar in range(k):
        wanted = _expected(Q, of[:, scalar], np.flatnonzero(members[:, scalar]), others[:, scalar])
        assert found[scalar] == pytest.approx(wanted, rel=1e-8)


def test_of_many_errors_random_vectors_find_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(independent, "VECTORS", 30)
    result, Q, columns = _dense(5)
    of = columns["p"]
    variance = np.array([[Q[c, c] for c in row] for row in of])
    found = independent_errors(result, "p", np.ones(of.shape, bool), variance, np.zeros(of.shape))
    for scalar in range(3):
        wanted = _expected(Q, of[:, scalar], np.arange(len(of)), np.zeros(len(of)))
        assert found[scalar] == pytest.approx(wanted, rel=3 * np.sqrt(2 / 30))


def test_what_has_no_members_has_no_count() -> None:
    result, _, columns = _dense(6)
    members = np.zeros(columns["p"].shape, bool)
    members[:, 0] = True
    found = independent_errors(result, "p", members, np.ones(members.shape), np.zeros(members.shape))
    assert np.isfinite(found[0])
    assert np.isnan(found[1:]).all()


def test_predictions_without_themselves_have_the_covariance_of_their_residuals() -> None:
    """Cov(v) = I - J Q J' between all records, d = G v; the third component of one record has no prediction."""
    result, Q, columns = _dense(7)
    rng = np.random.default_rng(3)
    block = np.array([3, 11, 4, 25, 17])
    J, gain = 0.3 * rng.normal(size=(5, 3, 3)), rng.normal(size=(5, 3, 3))
    gain[2, 2] = 0.0
    A = np.zeros((15, len(Q)))
    for k, b in enumerate(block):
        A[3 * k : 3 * k + 3][:, columns["p"][b]] = J[k]
    G = np.zeros((15, 15))
    for k in range(5):
        G[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = gain[k]
    C = G @ (np.eye(15) - A @ Q @ A.T) @ G.T
    found = independent_predictions(result, "p", block, J, gain)
    for component in range(3):
        rows = 3 * np.arange(5) + component
        D = C[np.ix_(rows, rows)]
        assert found[component] == pytest.approx(np.trace(D) ** 2 / np.trace(D @ D), rel=1e-8)
