from __future__ import annotations

import numpy as np

from aatri.orientation.refinement.flying_height import station_heights_m


def test_a_vertical_image_gives_its_height_and_a_single_point_none() -> None:
    plan_m = np.array([[0.0, 0.0], [200.0, 50.0], [-120.0, 180.0], [40.0, 40.0]])
    xy_mm = plan_m * 150.0 / 600.0
    found = station_heights_m(np.array([0, 0, 0, 1]), xy_mm, plan_m, np.full(4, 20.0), np.array([150.0, 150.0, 150.0]))
    np.testing.assert_allclose(found, [620.0, np.nan, np.nan], rtol=1e-12)


def test_points_nearer_to_each_other_than_a_tenth_of_the_principal_distance_tell_nothing() -> None:
    """Two points 9 mm and 12 mm apart in x and y: 15 mm, a tenth of 150 mm; on 36 m and 48 m of ground from 600 m."""
    ground_m, height_m = np.array([[0.0, 0.0], [36.0, 48.0]]), np.array([10.0, 30.0])
    for factor, expected in ((1.0001, 20.0 + 600.0 / 1.0001), (0.9999, np.nan)):
        xy_mm = factor * np.array([[1.0, 2.0], [10.0, 14.0]])
        found = station_heights_m(np.zeros(2, dtype=int), xy_mm, ground_m, height_m, np.array([150.0]))
        np.testing.assert_allclose(found, [expected], rtol=1e-9)
