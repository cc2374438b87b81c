"""The centre of a mark is found whatever its shape; what is no mark has none."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy.ndimage import gaussian_filter

from aatri.measuring.centres import centre_of_symmetry

Array = npt.NDArray[Any]
SIDE, FINE = 81, 12
SHAPES = {
    "cross": lambda u, v: ((abs(u) < 15) & (abs(v) < 2)) | ((abs(v) < 15) & (abs(u) < 2)),
    "dot": lambda u, v: np.hypot(u, v) < 5,
    "ring": lambda u, v: abs(np.hypot(u, v) - 6) < 1.2,
    "fields": lambda u, v: u * v > 0,
    "edge": lambda u, v: u > 0,
}


def _picture(shape: str, centre: Array, turn_deg: float, seed: int) -> Array:
    """A mark of 120 grey values with blur 1 and noise 5."""
    at = (np.arange(SIDE * FINE) + 0.5) / FINE - 0.5
    x, y = np.meshgrid(at - centre[0], at - centre[1])
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    inside = SHAPES[shape](c * x + s * y, -s * x + c * y).reshape(SIDE, FINE, SIDE, FINE).mean(axis=(1, 3))
    noise = np.random.default_rng(seed).normal(0, 5, (SIDE, SIDE))
    return np.asarray(np.clip(60 + 120 * gaussian_filter(inside, 1.0) + noise, 0, 255).round())


@pytest.mark.parametrize("turn_deg", [0.0, 31.0])
@pytest.mark.parametrize("shape", ["cross", "dot", "ring", "fields"])
def test_a_mark_is_found_to_some_hundredths_of_a_pixel(shape: str, turn_deg: float) -> None:
    rng = np.random.default_rng(2)
    t = []
    for seed in range(3):
        centre = 40 + rng.uniform(0, 1, 2)
        found = centre_of_symmetry(_picture(shape, centre, turn_deg, seed), centre + rng.uniform(-4, 4, 2), 10)
        assert found is not None
        assert np.abs(found[0] - centre).max() < 0.12
        t.append((found[0] - centre) / found[1])
    assert np.sqrt(np.mean(np.square(t))) < 2.0  # its standard deviations are of the right size


def test_an_edge_and_noise_have_no_centre() -> None:
    at = np.array([40.0, 40.0])
    assert centre_of_symmetry(_picture("edge", at, 20.0, 1), at, 10) is None
    noise = np.random.default_rng(3).normal(100, 5, (SIDE, SIDE))
    assert centre_of_symmetry(noise, at, 10) is None
    assert centre_of_symmetry(np.full((SIDE, SIDE), 7.0), at, 10) is None
