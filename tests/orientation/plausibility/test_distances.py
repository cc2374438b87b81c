"""The common scale of distances: told with its size, and neither noise nor a single wrong distance is one."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.orientation.plausibility.distances import scale_notes

TRUE_M = np.array([782.0, 673.0, 451.0, 1203.0, 95.0])
SIGMA_M = np.full(5, 0.01)


@pytest.mark.parametrize(("ppm", "how"), [(400, "longer"), (-80, "shorter")])
def test_a_scale_is_told_with_its_standard_deviation(ppm: float, how: str) -> None:
    (note,) = scale_notes(TRUE_M * (1 + 1e-6 * ppm), TRUE_M, SIGMA_M)
    sigma = 1e6 * 0.01 / np.sqrt((TRUE_M**2).sum())
    assert f"{abs(ppm)} ppm (+- {sigma:.0f}) {how}" in note.text
    assert note.level == "warning"


def test_noise_is_no_scale() -> None:
    for seed in range(100):
        noise = np.random.default_rng(seed).normal(0, 0.005, 5)
        assert scale_notes(TRUE_M + noise, TRUE_M, SIGMA_M) == []


def test_a_single_wrong_distance_and_too_few_are_no_scale() -> None:
    wrong = TRUE_M + np.array([0.0, 0.3, 0, 0, 0])
    assert scale_notes(wrong, TRUE_M, SIGMA_M) == []
    assert scale_notes(TRUE_M[:2] * 1.001, TRUE_M[:2], SIGMA_M[:2]) == []
    assert scale_notes(TRUE_M * 1.001, TRUE_M, np.zeros(5)) == []
