"""Heights above sea level in map and tangent frames."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.frames.heights import height_above_sea_level, is_tangent_frame

R = 6_371_000.0


def test_points_of_a_level_surface_have_one_height_in_the_tangent_frame() -> None:
    angle = np.deg2rad([0.0, 0.1, 0.8])
    h = 1234.5
    xyz = np.column_stack([(R + h) * np.sin(angle), np.zeros(3), (R + h) * np.cos(angle) - R])
    assert height_above_sea_level(xyz, tangent=True) == pytest.approx(np.full(3, h), abs=1e-8)


def test_in_a_map_frame_the_third_coordinate_is_the_height() -> None:
    assert height_above_sea_level(np.array([[4e5, 5e6, 77.0]]), tangent=False).tolist() == [77.0]


@pytest.mark.parametrize(
    ("crs", "tangent"),
    [("+proj=topocentric +R=6371000 +lat_0=30 +lon_0=114 +h_0=0", True), ("local", False), ("EPSG:32650", False)],
)
def test_a_tangent_frame_says_so(crs: str, tangent: bool) -> None:
    assert is_tangent_frame(crs) is tangent
