"""Residuals with a smooth common part ask for parameters; a local one, a small one and none do not."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.checks.after.smooth_signal import smooth_signal
from aatri.orientation.refinement.collocation import collocate


def _residuals(half_wave_mm: float, size_mm: float) -> tuple[np.ndarray, np.ndarray]:
    """6,000 residuals of 4 um about a wave over the plate."""
    chance = np.random.default_rng(7)
    xy = chance.uniform(-110.0, 110.0, (6000, 2))
    wave = size_mm * np.sin(np.pi * xy / half_wave_mm) * np.cos(np.pi * xy[:, ::-1] / half_wave_mm)
    return xy, wave + chance.normal(0, 0.004, xy.shape)


@pytest.mark.parametrize(
    ("half_wave_mm", "size_mm", "told"), [(90.0, 0.006, 1), (15.0, 0.006, 0), (90.0, 0.001, 0), (90.0, 0.0, 0)]
)
def test_a_smooth_and_large_signal_is_told(half_wave_mm: float, size_mm: float, told: int) -> None:
    xy, residual = _residuals(half_wave_mm, size_mm)
    found = smooth_signal({0: collocate(xy, residual)}, np.array(["c1"]), np.array([155.0]))
    assert len(found) == told
    assert all("self_calibration" in f.remedy and f.level == "warning" for f in found)
