from __future__ import annotations

import numpy as np

from aatri.orientation.refinement.flying_height import station_heights_m


def test_a_vertical_image_gives_its_height_and_a_single_point_none() -> None:
    plan_m = np.array([[0.0, 0.0], [200.0, 50.0], [-120.0, 180.0], [40.0, 40.0]])
    xy_mm = plan_m * 150.0 / 600.0
    found = station_heights_m(np.array([0, 0, 0, 1]), xy_mm, plan_m, np.full(4, 20.0), np.array([150.0, 150.0, 150.0]))
    np.testing.assert_allclose(found, [620.0, np.nan, np.nan], rtol=1e-12)
