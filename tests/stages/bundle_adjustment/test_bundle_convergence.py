"""Starts far from the truth: a small part of the grid of tests/campaigns/convergence_basin.py."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.orientation.bundle.result import BundleResult
from tests.campaigns.convergence_basin import disturbed, outcome, well_posed, with_start_c
from tests.orientation.bundle.parts import Parts, adjust_bundle


@pytest.fixture(scope="module")
def block() -> tuple[Parts, BundleResult, float]:
    given, height_m = well_posed(1)
    return given, adjust_bundle(given, tolerance=1e-6), height_m


@pytest.fixture(scope="module")
def free_c() -> tuple[Parts, BundleResult]:
    given, _ = well_posed(1, free_c=True)
    return given, adjust_bundle(given, tolerance=1e-6)


@pytest.mark.parametrize(("angle_deg", "share"), [(10.0, 0.1), (30.0, 0.0), (30.0, 0.1), (0.0, 0.3)])
def test_angles_30_degrees_wrong_converge(
    block: tuple[Parts, BundleResult, float], angle_deg: float, share: float
) -> None:
    given, reference, height_m = block
    start = disturbed(given, np.random.default_rng(7), angle_deg, share * height_m)
    assert outcome(start, reference) == "right"


@pytest.mark.parametrize("factor", [0.5, 0.7, 2.0, 4.0])
def test_a_principal_distance_wrong_by_half_to_four_times_converges(
    free_c: tuple[Parts, BundleResult], factor: float
) -> None:
    given, reference = free_c
    assert outcome(with_start_c(given, factor), reference) == "right"


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_a_hopeless_start_is_no_silent_success(block: tuple[Parts, BundleResult, float], seed: int) -> None:
    given, reference, height_m = block
    start = disturbed(given, np.random.default_rng(seed), 90.0, height_m)
    assert outcome(start, reference) != "false"
