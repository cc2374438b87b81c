"""Standard deviations of a few control points that are too small: the distribution of residuals tells, or nothing."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.adjustment.statistics.small_scales import small_class_scale
from aatri.arrays import Float

POINTS, SIGMA = 13, 0.2
RECORD = np.repeat(np.arange(POINTS), 3)


def _cofactor(sigma: float) -> Float:
    """Of 39 whitened residuals of control given to `sigma`, where the images see each coordinate to 1, but no datum."""
    N = np.eye(39) - np.kron(np.ones((POINTS, POINTS)) / POINTS, np.eye(3))  # the images know no translation
    return np.eye(39) - np.linalg.inv(np.eye(39) + sigma**2 * N)


def _residuals(scale: float, seed: int, sigma: float = SIGMA) -> tuple[Float, Float]:
    """v of errors `scale` times those given: v = R e + what the images' errors do, cofactor R (s^2 R + I - R)."""
    R = _cofactor(sigma)
    size, axes = np.linalg.eigh(R)
    variance = np.maximum(size, 0.0) * (1.0 + (scale**2 - 1.0) * np.maximum(size, 0.0))
    return axes @ (np.sqrt(variance) * np.random.default_rng(seed).standard_normal(39)), R


def test_right_standard_deviations_are_left_alone() -> None:
    told = sum(small_class_scale(*_residuals(1.0, seed), RECORD)[0] > 1.0 for seed in range(600))
    assert told <= 3  # 0.6 by the level of 0.1 %; more than 3 once in 300


@pytest.mark.parametrize("scale", [5.0, 10.0])
def test_a_fraction_of_the_true_ones_is_told(scale: float) -> None:
    found = np.array([small_class_scale(*_residuals(scale, seed, 0.5), RECORD) for seed in range(40)])
    assert (found[:, 0] > 1.0).all()
    assert np.median(found[:, 0]) == pytest.approx(scale, rel=0.15)
    size = np.linalg.eigvalsh(_cofactor(0.5 * scale)).sum()  # redundancy with the right standard deviations
    assert np.median(found[:, 1]) == pytest.approx(size, rel=0.1)


def test_next_to_no_redundancy_tells_nothing() -> None:
    """Of images that see the points twenty times worse than the control is given."""
    told = [small_class_scale(*_residuals(5.0, seed, 0.05), RECORD)[0] > 1.0 for seed in range(40)]
    assert sum(told) < 4


@pytest.mark.parametrize("wrong", [[4], [2, 9]])
def test_gross_errors_are_no_scale(wrong: list[int]) -> None:
    v, R = _residuals(1.0, 1, 0.5)
    error = np.zeros(39)
    error[np.isin(RECORD, wrong)] = 60.0
    assert small_class_scale(v + R @ error, R, RECORD)[0] == 1.0
