"""Points that come to lie behind the images are taken out, and what is left must determine a pair."""

from __future__ import annotations

import numpy as np

from aatri.geometry.coplanarity import RayPairs
from aatri.orientation.relative.loops import Portion, oriented_from
from aatri.orientation.relative.orientations import PairSettings, RelativeOrientations
from aatri.progress import SILENT

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


def _from_vertical(rays: RayPairs) -> RelativeOrientations:
    def start(portion: Portion) -> None:
        portion.pose[:] = np.column_stack([np.eye(3), BASE])

    return oriented_from(rays, np.array([0, len(rays.left)]), ((start, 0.3),), PairSettings(4.0, 20, 5), SILENT)


def test_those_behind_go_and_the_others_orient_the_pair() -> None:
    found = _from_vertical(_rays(9, 4))
    np.testing.assert_array_equal(found.active, np.arange(13) < 9)
    np.testing.assert_allclose(found.left_from_right[0], np.eye(3), atol=1e-9)


def test_fewer_than_five_in_front_are_no_orientation() -> None:
    found = _from_vertical(_rays(4, 9))
    assert not found.formed[0]
    assert found.reasons[0] == "no relation between the images fits one orientation"
