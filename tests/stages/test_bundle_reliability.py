"""Reliability of a whole block: identities and calibration."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.artifacts.solution import Solution
from aatri.stages.bundle_adjustment.bundle import BundleOptions
from tests.stages.chain import run_chain, simulated

SMALL = {
    "preset": "rc30",
    "flight": {"strips": 3, "images_per_strip": 5, "cross_strips": 1},
    "ties": {"new_points": 250},
    "known": {"full": 12},
}


@pytest.fixture(scope="module")
def solution() -> Solution:
    return run_chain(simulated(**SMALL), BundleOptions(reliability=True)).bundle


def test_redundancy_numbers_sum_to_the_redundancy(solution: Solution) -> None:
    assert solution.tests is not None
    r = solution.tests.redundancy
    assert np.nansum(r) == pytest.approx(solution.redundancy, abs=1e-8 * solution.redundancy)
    assert ((r[np.isfinite(r)] >= 0) & (r[np.isfinite(r)] <= 1)).all()


def test_every_observation_has_its_row(solution: Solution) -> None:
    assert solution.tests is not None
    assert len(solution.tests) == len(solution.residuals)
    observed = np.isfinite(solution.residuals.residual)
    assert (np.isfinite(solution.tests.redundancy) == observed).all()


def test_without_gross_errors_the_tests_are_standard_normal(solution: Solution) -> None:
    assert solution.tests is not None
    w = solution.tests.test[np.isfinite(solution.tests.test)]
    # some 2,500 correlated values of about 1,200 degrees of freedom: 4 sigma of the mean square are 0.16
    assert (w**2).mean() == pytest.approx(1.0, abs=0.16)
    assert np.abs(w).max() < 4.5


def test_reliability_is_opt_in() -> None:
    assert run_chain(simulated(**SMALL)).bundle.tests is None
