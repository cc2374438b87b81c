"""The global test: tables of chi-square, calibration, the two conditions of a warning, the limit."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.adjustment.statistics.global_test import (
    global_test,
    largest_sigma0,
    pooled_test,
    refuse_misfit,
    sigma0_interval,
    sigma0_note,
    single_misfits,
)
from aatri.errors import ConvergenceError

NAN = float("nan")


def test_the_interval_of_sigma0_is_that_of_the_tables_of_chi_square() -> None:
    """chi-square with 10 degrees of freedom: 3.247 and 20.483 at 2.5 % and 97.5 % (any table)."""
    np.testing.assert_allclose(np.square(sigma0_interval(10)) * 10, [3.247, 20.483], atol=5e-4)


@pytest.mark.parametrize(
    ("sigma0", "redundancy", "verdict"),
    [
        (1.3, 10, "fits"),
        (1.77, 10, "fits"),  # chi-square of 10: 1.265 and 31.42 at 0.05 % and 99.95 % (tables): 0.356 to 1.773
        (1.78, 10, "warned"),
        (0.36, 10, "fits"),
        (0.35, 10, "far"),
        (2.01, 10, "far"),
        (1.0, 24_000, "fits"),
        (1.012, 24_000, "fits"),  # 95 %: 0.991 to 1.009; 99.9 %: 1 +- 3.29 / sqrt(2 r)
        (1.02, 24_000, "outside"),
        (1.24, 24_000, "outside"),
        (1.26, 24_000, "warned"),
        (0.81, 24_000, "outside"),
        (0.79, 24_000, "warned"),
        (0.1, 1, "fits"),
        (5.0, 0, "untested"),
        (NAN, 5, "untested"),
    ],
)
def test_a_warning_takes_both_the_interval_and_a_size(sigma0: float, redundancy: int, verdict: str) -> None:
    test = global_test(sigma0, redundancy)
    assert test.verdict == verdict
    note = sigma0_note(test)
    assert note.level == ("warning" if verdict in ("warned", "far") else "note")
    assert "sigma0" in note.text
    if verdict != "untested":
        assert f"{sigma0:.3f}, expected {test.low:.3f} to {test.high:.3f}" in note.text


def test_what_the_old_tolerance_of_ten_per_cent_hid_is_told() -> None:
    assert "outside, but near 1" in sigma0_note(global_test(1.09, 24_000)).text


def test_beyond_max_sigma0_there_is_no_result() -> None:
    refuse_misfit(global_test(19.9, 100))
    refuse_misfit(global_test(NAN, 0))
    with pytest.raises(ConvergenceError, match=r"sigma0 of strips is 312, beyond max_sigma0 = 20") as caught:
        refuse_misfit(global_test(312.0, 100), what="of strips")
    assert caught.value.remedy
    refuse_misfit(global_test(312.0, 100), 1000.0)


@pytest.mark.parametrize(
    ("sigma_rad", "limit"), [(0.0, 20.0), (1e-4, 20.0), (5.1e-5, 20.0), (4e-5, 25.0), (2e-6, 500.0)]
)
def test_sigma0_is_limited_by_what_directions_are_measured_to_at_worst(sigma_rad: float, limit: float) -> None:
    """1 mrad: 4e-5 rad, which are 6 um at 150 mm, may be 25 times too small."""
    assert largest_sigma0(sigma_rad) == pytest.approx(limit)


def test_the_pooled_sigma0_is_that_of_all_squares_over_all_redundancies() -> None:
    test = pooled_test(np.array([2.0, NAN, 1.0]), np.array([1, 0, 3]))
    assert (test.sigma0, test.redundancy) == (pytest.approx(np.sqrt(7 / 4)), 4)
    assert pooled_test(np.array([NAN]), np.array([0])).verdict == "untested"


def test_a_set_without_errors_lists_a_single_one_in_one_of_a_thousand() -> None:
    rng = np.random.default_rng(4)
    redundancy = np.tile([2, 10, 40], 20)
    listed = sum(
        bool(single_misfits(np.sqrt(rng.chisquare(redundancy) / redundancy), redundancy).any()) for _ in range(20_000)
    )
    assert 8 <= listed <= 35  # 20 expected: binomial, 99.9 %


def test_the_single_one_that_does_not_fit_is_listed() -> None:
    redundancy = np.full(50, 10)
    sigma0 = np.ones(50)
    sigma0[7] = 2.2
    assert np.flatnonzero(single_misfits(sigma0, redundancy)).tolist() == [7]
    assert not single_misfits(np.full(3, 1.2), np.full(3, 100_000)).any()
