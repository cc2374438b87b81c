"""Points laid on shapes."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.simulation.shapes import _round


@pytest.mark.parametrize("seed", range(5))
def test_points_lie_all_around_a_cylinder_without_a_gap(seed: int) -> None:
    """Within 0.3 of their step of regular places, so that no gap is wider than 1.6 steps."""
    n = 12
    laid = _round("cylinder", n, 4.0, np.random.default_rng(seed))
    out = laid.away[:, 0]
    across = np.linalg.svd(out)[2][:2]
    x, y = across @ out.T
    turn = np.sort(np.arctan2(y, x))
    gaps = np.diff(np.append(turn, turn[0] + 2 * np.pi))
    assert gaps.max() <= 1.6 * 2 * np.pi / n + 1e-12
    np.testing.assert_allclose(np.linalg.norm(laid.offset_m @ across.T, axis=1), 2.0)


def test_points_of_a_sphere_lie_on_it() -> None:
    laid = _round("sphere", 9, 6.0, np.random.default_rng(2))
    np.testing.assert_allclose(np.linalg.norm(laid.offset_m, axis=1), 3.0)
    np.testing.assert_allclose(laid.away[:, 0] * 3.0, laid.offset_m, atol=1e-12)
