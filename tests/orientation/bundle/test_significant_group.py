"""A group whose estimate lies within its own standard deviations is no finding."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from aatri.adjustment.statistics.limits import ALARM
from aatri.orientation.bundle.groups.score_tests import is_significant, share_without_largest


@pytest.mark.parametrize(
    ("value", "sigma", "significant"),
    [([-0.192], [1.9], False), ([0.0107, 0.0031], [0.006, 0.0034], False), ([0.03, 0.0], [0.006, 0.0034], True)],
)
def test_what_lies_within_its_standard_deviations_is_none(
    value: list[float], sigma: list[float], significant: bool
) -> None:
    assert is_significant(np.array(value), np.diag(np.square(sigma))) is significant


def test_parameters_are_judged_together_whatever_their_units() -> None:
    """Each within two sigmas, but of opposite signs though correlated by 0.99: d^2 = 2 t^2 / (1 - rho)."""
    units = np.array([1e-6, 1e3])
    C = np.array([[1.0, 0.99], [0.99, 1.0]])
    value = np.array([1.5, -1.5])
    assert chi2.isf(ALARM, 2) < 2 * 1.5**2 / (1 - 0.99)
    assert is_significant(units * value, np.outer(units, units) * C)
    assert not is_significant(units * np.abs(value), np.outer(units, units) * C)


def test_where_no_covariance_is_known_nothing_is_dropped() -> None:
    assert is_significant(np.zeros(2), np.full((2, 2), np.nan))


def test_one_wrong_member_that_carries_others_along_is_no_group() -> None:
    """Two points of two rays each move with it along their bases, where nothing holds them: nothing is gained."""
    before, after = np.array([[80.0, 0.0], [0.5, 0.9], [1.1, -0.3]]), np.array([[0.2, 0.0], [0.5, 0.8], [1.1, -0.3]])
    assert share_without_largest(before, after) == pytest.approx((0.9**2 - 0.8**2) / (80**2 - 0.2**2 + 0.9**2 - 0.8**2))
    together = np.array([[9.0, 0.0], [8.0, 1.0], [0.0, 10.0]])
    assert share_without_largest(together, np.zeros((3, 2))) == pytest.approx((81 + 65) / (81 + 65 + 100))
