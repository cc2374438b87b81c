"""Pairs that fit by chance, whose points lie behind, in a wrong minimum."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.geometry.coplanarity import RayPairs
from aatri.geometry.rotations import log_rotation
from aatri.orientation.relative.loops import Portion, oriented_from
from aatri.orientation.relative.orientations import PairSettings, RelativeOrientations
from aatri.orientation.relative.pairs import relative_orientations
from aatri.progress import SILENT
from tests.orientation.relative.pairs import gruber_ground, rays_of, relative_orientation, rotation, simulate

# As many points as fit one orientation by chance make no model.

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


@pytest.mark.slow(after=1)
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


# Points that come to lie behind the images are taken out, and what is left must determine a pair.

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


# A pair with exchanged point numbers whose least-squares solution from parallel images is wrong altogether.
#
# Film images of 153.84 mm and 5 um, 61 % overlap: four points have gross errors, two of them the coordinates of another
# point. From parallel images the adjustment ends 30 degrees off, with the base upwards: there 18 of the 41 points fit,
# and the median point is off by less than the limit.

# x1, y1, x2, y2 in mm
MEASURED = [
    (94.673, 80.563, 12.110, 77.760),
    (84.343, 76.996, 1.951, 74.329),
    (88.115, 77.387, 5.627, 74.692),
    (87.781, 78.450, 5.334, 75.753),
    (85.227, 73.216, 2.728, 70.625),
    (89.493, 78.015, 6.986, 75.302),
    (93.974, -5.207, 9.741, -6.489),
    (82.551, -11.215, -1.589, -12.278),
    (85.046, 3.620, 1.178, 2.275),
    (97.633, -9.967, 13.234, -11.213),
    (84.794, -7.773, 0.685, -8.924),
    (87.150, -6.396, 3.006, -7.599),
    (98.230, -84.350, 12.010, -84.490),
    (91.751, -87.301, 5.563, -87.305),
    (84.641, -82.350, -1.294, -82.306),
    (91.228, -84.574, 5.110, -84.599),
    (91.929, -84.564, 5.799, -84.597),
    (92.357, -90.191, 6.070, -90.163),
    (-1.232, 80.858, -82.414, 78.921),
    (0.879, 81.544, -79.336, 79.382),
    (2.023, 76.547, -78.314, 74.507),
    (2.202, 75.951, -78.154, 73.908),
    (-1.138, 73.150, -81.459, 71.204),
    (2.747, 78.507, 96.171, -83.331),
    (5.348, -3.401, -76.874, -3.751),
    (-4.959, -3.247, -86.917, -3.507),
    (3.002, -9.854, -79.343, -10.062),
    (1.019, -3.830, -81.107, -4.130),
    (-2.961, 0.647, -84.868, 0.303),
    (7.938, -10.878, -77.436, -8.553),
    (6.480, -74.891, -77.646, -73.869),
    (-8.760, -75.805, -92.537, -74.551),
    (0.157, -84.207, 81.001, -30.114),
    (-2.322, -82.424, -86.435, -81.131),
    (5.991, -82.281, -78.307, -81.119),
    (-5.234, -85.807, -89.367, -84.429),
    (12.253, -27.971, -70.764, -27.913),
    (22.761, -31.508, -60.587, -31.509),
    (-25.011, -20.525, -106.866, -20.194),
    (35.553, -98.396, -49.858, -97.385),
    (60.326, -2.893, -23.161, -3.842),
]
WRONG = [18, 23, 29, 32]


def _rays_of_wrong_minimum() -> RayPairs:
    xy, c, sigma = np.array(MEASURED), np.full((len(MEASURED), 1), -153.84), np.full((len(MEASURED), 2), 0.005)
    return RayPairs(np.hstack([xy[:, :2], c]), np.hstack([xy[:, 2:], c]), sigma, sigma)


def test_points_that_fit_a_wrong_orientation_do_not_keep_it_from_the_right_one() -> None:
    rays, right = _rays_of_wrong_minimum(), ~np.isin(np.arange(len(MEASURED)), WRONG)
    clean, found = relative_orientation(rays.take(right)), relative_orientation(rays)
    np.testing.assert_array_equal(found.active, right)
    assert np.linalg.norm(log_rotation(found.left_from_right @ clean.left_from_right.T)) < 1e-6
    assert found.base[0] > 0.99


def test_so_it_is_among_many_pairs() -> None:
    rays = _rays_of_wrong_minimum()
    found = relative_orientations(rays, np.array([0, len(rays.left)]))
    np.testing.assert_array_equal(np.flatnonzero(~found.active), WRONG)
