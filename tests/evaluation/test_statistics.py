from __future__ import annotations

import numpy as np
import pytest

from aatri.evaluation.statistics import sigma0_fits, sigma0_interval


def test_the_interval_of_sigma0_is_that_of_the_tables_of_chi_square() -> None:
    """chi-square with 10 degrees of freedom: 3.247 and 20.483 at 2.5 % and 97.5 % (any table)."""
    np.testing.assert_allclose(np.square(sigma0_interval(10)) * 10, [3.247, 20.483], atol=5e-4)


@pytest.mark.parametrize(
    ("sigma0", "redundancy", "fits"),
    [(1.3, 10, True), (1.5, 10, False), (0.5, 10, False), (1.09, 100_000, True), (1.2, 100_000, False), (5.0, 0, True)],
)
def test_sigma0_fits_within_chance_or_near_one(sigma0: float, redundancy: int, fits: bool) -> None:
    assert sigma0_fits(sigma0, redundancy) is fits
