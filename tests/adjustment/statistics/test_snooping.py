"""Data snooping: detection, size, re-admission, calibration."""

from __future__ import annotations

import numpy as np
import pytest

from tests.adjustment.dense import DenseResult, adjust
from tests.adjustment.statistics.snooping import SnoopedResult, snoop, statistics


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
