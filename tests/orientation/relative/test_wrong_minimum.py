"""A pair with exchanged point numbers whose least-squares solution from parallel images is wrong altogether.

Film images of 153.84 mm and 5 um, 61 % overlap: four points have gross errors, two of them the coordinates of another
point. From parallel images the adjustment ends 30 degrees off, with the base upwards: there 18 of the 41 points fit,
and the median point is off by less than the limit.
"""

from __future__ import annotations

import numpy as np

from aatri.geometry.coplanarity import RayPairs
from aatri.geometry.rotations import log_rotation
from aatri.orientation.relative.pairs import relative_orientations
from tests.orientation.relative.pairs import relative_orientation

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


def _rays() -> RayPairs:
    xy, c, sigma = np.array(MEASURED), np.full((len(MEASURED), 1), -153.84), np.full((len(MEASURED), 2), 0.005)
    return RayPairs(np.hstack([xy[:, :2], c]), np.hstack([xy[:, 2:], c]), sigma, sigma)


def test_points_that_fit_a_wrong_orientation_do_not_keep_it_from_the_right_one() -> None:
    rays, right = _rays(), ~np.isin(np.arange(len(MEASURED)), WRONG)
    clean, found = relative_orientation(rays.take(right)), relative_orientation(rays)
    np.testing.assert_array_equal(found.active, right)
    assert np.linalg.norm(log_rotation(found.left_from_right @ clean.left_from_right.T)) < 1e-6
    assert found.base[0] > 0.99


def test_so_it_is_among_many_pairs() -> None:
    rays = _rays()
    found = relative_orientations(rays, np.array([0, len(rays.left)]))
    np.testing.assert_array_equal(np.flatnonzero(~found.active), WRONG)
