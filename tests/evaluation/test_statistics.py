from __future__ import annotations

import numpy as np
import pytest

from aatri.evaluation.statistics import bias, largest, rmse


def test_columns_are_taken_one_by_one_and_nan_takes_no_part() -> None:
    d = np.array([[3.0, np.nan, -1.0], [-4.0, np.nan, 2.0], [np.nan, np.nan, 2.0]])
    np.testing.assert_allclose(rmse(d), [np.sqrt(12.5), np.nan, np.sqrt(3.0)])
    np.testing.assert_allclose(bias(d), [-0.5, np.nan, 1.0])
    np.testing.assert_allclose(largest(d), [4.0, np.nan, 2.0])
    assert largest(np.zeros((0, 2))) == pytest.approx(np.nan, nan_ok=True)
