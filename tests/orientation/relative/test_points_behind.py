"""Points that come to lie behind the images are taken out, and what is left must determine a pair."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.errors import ConvergenceError
from aatri.geometry.coplanarity import RayPairs
from aatri.orientation.relative.pair_adjustment import adjust_pair, state_of

C_MM = 100.0
BASE = np.array([1.0, 0.0, 0.0])


def _rays(in_front: int, behind: int) -> RayPairs:
    """Vertical images one base apart, at a depth of two to three bases in front of both, or behind both."""
    rng = np.random.default_rng(4)
    n = in_front + behind
    X = np.column_stack([rng.uniform(-0.5, 1.5, n), rng.uniform(-1, 1, n), rng.uniform(2, 3, n)])
    X[:in_front, 2] *= -1
    left, right = (-C_MM * (X - centre) / (X - centre)[:, 2:] for centre in (np.zeros(3), BASE))
    sigma = np.full((n, 2), 0.005)
    return RayPairs(left, right, sigma, sigma)


def test_those_behind_go_and_the_others_orient_the_pair() -> None:
    rays = _rays(9, 4)
    found = adjust_pair(rays, state_of(np.eye(3), BASE), np.ones(13, dtype=bool), limit=4.0, max_iterations=20)
    np.testing.assert_array_equal(found.active, np.arange(13) < 9)
    np.testing.assert_allclose(found.result.state[0], np.eye(3), atol=1e-9)


def test_fewer_than_five_in_front_are_no_orientation() -> None:
    rays = _rays(4, 9)
    with pytest.raises(ConvergenceError, match="only 4 of 13 points fit and lie in front of both images"):
        adjust_pair(rays, state_of(np.eye(3), BASE), np.ones(13, dtype=bool), limit=4.0, max_iterations=20)
