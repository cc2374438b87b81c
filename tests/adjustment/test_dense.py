"""Dense least squares: against closed forms, numpy and NIST."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.errors import ConvergenceError, GeometryError
from tests.adjustment.dense import adjust, undetermined


def _line(x: np.ndarray, y: np.ndarray):
    A = np.column_stack([np.ones_like(x), x])
    return lambda state: (A @ state - y, A)


def test_a_straight_line_equals_the_closed_form() -> None:
    x, y = np.array([0.0, 1.0, 2.0, 3.0]), np.array([1.1, 2.9, 5.2, 6.8])
    result = adjust(_line(x, y), lambda s, d: s + d, np.zeros(2))
    expected, squares, *_ = np.linalg.lstsq(np.column_stack([np.ones(4), x]), y, rcond=None)
    np.testing.assert_allclose(result.state, expected, rtol=1e-13)
    assert result.redundancy == 2
    assert result.sigma0 == pytest.approx(np.sqrt(squares[0] / 2), rel=1e-12)
    # the variance of a slope is 1 / sum (x - mean)^2
    assert result.covariance[1, 1] == pytest.approx(1 / ((x - x.mean()) ** 2).sum(), rel=1e-12)


def test_redundancy_numbers_sum_to_the_redundancy() -> None:
    rng = np.random.default_rng(1)
    A, y = rng.normal(size=(12, 4)), rng.normal(size=12)
    result = adjust(lambda s: (A @ s - y, A), lambda s, d: s + d, np.zeros(4))
    r = result.redundancy_numbers()
    assert r.sum() == pytest.approx(8, abs=1e-10)
    assert ((r >= 0) & (r <= 1)).all()


def test_misra1a_of_nist_from_the_far_start() -> None:
    # NIST StRD Misra1a, start 1, certified values
    x = np.array([77.6, 114.9, 141.1, 190.8, 239.9, 289.0, 332.8, 378.4, 434.8, 477.3, 536.8, 593.1, 689.1, 760.0])
    y = np.array([10.07, 14.73, 17.94, 23.93, 29.61, 35.18, 40.02, 44.82, 50.76, 55.05, 61.01, 66.40, 75.47, 81.78])

    def linearise(b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        e = np.exp(-b[1] * x)
        return b[0] * (1 - e) - y, np.column_stack([1 - e, b[0] * x * e])

    result = adjust(linearise, lambda s, d: s + d, np.array([500.0, 1e-4]), tolerance=1e-8, max_iterations=50)
    np.testing.assert_allclose(result.state, [2.3894212918e2, 5.5015643181e-4], rtol=1e-9)
    sigma = result.sigma0 * np.sqrt(np.diag(result.covariance))
    np.testing.assert_allclose(sigma, [2.7070075241, 7.2668688436e-6], rtol=1e-6)


def test_undetermined_unknowns_are_named() -> None:
    A = np.array([[1.0, 1.0, 0.0], [2.0, 2.0, 0.0], [3.0, 3.0, 1.0]])
    assert undetermined(A, ["east", "north", "height"]) == ["east with north"]
    with pytest.raises(GeometryError, match="east with north"):
        adjust(lambda s: (A @ s, A), lambda s, d: s + d, np.ones(3), names=["east", "north", "height"])


def test_an_unbounded_problem_is_a_failure_and_no_result() -> None:
    with pytest.raises(ConvergenceError):
        adjust(lambda s: (np.exp(-s), -np.exp(-s)[:, None]), lambda s, d: s + d, np.zeros(1), max_iterations=5)
