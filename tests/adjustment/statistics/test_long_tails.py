"""The tail of errors: where the limit of a residual comes from."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from aatri.adjustment.statistics.limits import limit_of_tests
from aatri.adjustment.statistics.long_tails import BEYOND, LEAST_FREEDOM, Tail, tail_of

N = 4000
LEVELS = (np.arange(N) + 0.5) / N
LIMIT = limit_of_tests(N)


@pytest.mark.parametrize("freedom", [5.0, 8.0])
@pytest.mark.parametrize("scale", [0.8, 1.0, 1.5])
def test_the_limit_is_that_of_the_longest_tail_that_the_residuals_allow(freedom: float, scale: float) -> None:
    tail = tail_of(np.abs(scale * stats.t(freedom).ppf(LEVELS)), LIMIT * scale)
    assert 0.75 * freedom <= tail.freedom <= 1.05 * freedom
    limit = scale * stats.t(freedom).isf(BEYOND / 2)
    assert 0.97 * limit <= tail.limit <= 1.35 * limit


def test_few_normal_residuals_allow_a_tail_and_many_do_not() -> None:
    levels = (np.arange(400) + 0.5) / 400
    limit = limit_of_tests(400)
    assert limit < tail_of(np.abs(stats.norm.ppf(levels)), limit).limit < 1.5 * limit


def test_normal_errors_have_the_limit_that_counts_the_tests() -> None:
    assert tail_of(np.abs(stats.norm.ppf(LEVELS)), LIMIT) == Tail(np.inf, LIMIT)


def test_gross_errors_make_no_tail() -> None:
    w = np.abs(stats.norm.ppf(LEVELS))
    w[:: N // 200] = np.geomspace(6.0, 1000.0, len(w[:: N // 200]))
    assert tail_of(w, LIMIT).limit < 1.2 * LIMIT


def test_longer_tails_than_measurements_have_are_gross_errors() -> None:
    assert tail_of(np.abs(stats.t(1.5).ppf(LEVELS)), LIMIT).freedom >= LEAST_FREEDOM


def test_a_few_residuals_have_no_tail() -> None:
    w = np.append(np.abs(stats.norm.ppf((np.arange(50) + 0.5) / 50)), 4.8)
    assert tail_of(w, 4.0).limit == 4.0


def test_images_of_unlike_quality_make_a_tail() -> None:
    """Their mixture is not normal, and its largest residuals are no gross errors."""
    rng = np.random.default_rng(3)
    w = np.abs(rng.uniform(0.6, 1.6, N) * rng.standard_t(5, N) * np.sqrt(3 / 5))
    assert (w > tail_of(w, LIMIT).limit).mean() < 1e-3 < 2 * (w > LIMIT).mean()
