"""As many points as fit one orientation by chance make no model."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.orientation.relative.orientations import RelativeOrientations
from aatri.orientation.relative.pairs import relative_orientations
from tests.orientation.relative.pairs import gruber_ground, rays_of, rotation, simulate

PAIRS, EVERY = 90, 3


def oriented(points: int, moved: int) -> RelativeOrientations:
    """Pairs of which every third has some points with each other's numbers in the right image."""
    rng, left, right = np.random.default_rng(8), [], []
    for pair in range(PAIRS):
        X = gruber_ground(3, rng, relief=0.05)[rng.permutation(18)[:points]]
        rays, _, _ = simulate(X, rotation(rng), rotation(rng), np.zeros(3), np.array([0.6, 0.0, 0.0]), rng)
        order = np.arange(points)
        order[: moved if pair % EVERY == 0 else 0] = np.roll(order[: moved if pair % EVERY == 0 else 0], 1)
        left.append(rays.left[:, :2])
        right.append(rays.right[order, :2])
    start = points * np.arange(PAIRS + 1)
    return relative_orientations(rays_of(np.concatenate(left), np.concatenate(right)), start, snooping_limit=4.0)


@pytest.mark.parametrize("points", [8, 10])
def test_images_whose_points_are_shuffled_make_no_model(points: int) -> None:
    """One choice in the mean of all would fit; most pairs have none."""
    made = oriented(points, moved=points)
    shuffled = np.arange(PAIRS) % EVERY == 0
    assert made.formed[shuffled].mean() < 0.03
    assert made.formed[~shuffled].mean() > 0.95


def test_a_quarter_of_wrong_numbers_costs_no_model() -> None:
    made = oriented(12, moved=3)
    assert made.formed.mean() > 0.95
    assert (made.redundancy[::EVERY] == 12 - 3 - 5).mean() > 0.9
