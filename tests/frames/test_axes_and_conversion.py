"""Axes, conversion, heights."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from aatri.errors import InputError
from aatri.frames.axes import in_order_of, in_right_handed_order
from aatri.frames.conversion import Frame, convert
from aatri.frames.heights import height_above_sea_level, is_tangent_frame

# Axes in any order, and conversion between frames.

MAP = Frame("map", ("north", "east", "up"), "EPSG:32650")
WGS = Frame("wgs", ("latitude", "longitude", "height"), "EPSG:4979")


@pytest.mark.parametrize("axes", list(itertools.permutations(("east", "north", "up"))))
def test_reordering_axes_and_back_is_the_identity(axes: tuple[str, ...]) -> None:
    rng = np.random.default_rng(1)
    xyz, covariance = rng.normal(size=(4, 3)), rng.normal(size=(4, 3, 3))
    assert (in_order_of(in_right_handed_order(xyz, axes), axes) == xyz).all()
    assert (in_order_of(in_right_handed_order(covariance, axes), axes) == covariance).all()
    named = np.array([["east", "north", "up"].index(a) for a in axes], float)[None]
    assert in_right_handed_order(named, axes).tolist() == [[0.0, 1.0, 2.0]]


def test_a_local_frame_cannot_be_converted() -> None:
    pytest.importorskip("pyproj")
    with pytest.raises(InputError, match="local"):
        convert(np.zeros((1, 3)), np.zeros((1, 3, 3)), WGS, Frame("site", ("east", "north", "up"), "local"))


def test_latitude_longitude_to_utm_turns_the_covariance_by_the_meridian_convergence() -> None:
    pytest.importorskip("pyproj")
    xyz = np.array([[40.7, 116.4, 100.0], [40.7, 117.0, 50.0]])
    covariance = np.tile(np.diag([1.0, 4.0, 9.0]), (2, 1, 1))  # north, east, up
    converted, spread = convert(xyz, covariance, WGS, MAP)
    # 117 degrees is the central meridian of zone 50: easting 500 km, no convergence
    assert converted[1, 0] == pytest.approx(500_000.0, abs=1e-6)
    k2 = (0.9996 * (1 - 50.0 / 6.38e6)) ** 2  # metres of the map for metres of the ground, at 50 m height
    np.testing.assert_allclose(spread[1], np.diag([4.0 * k2, k2, 9.0]), atol=1e-6)
    # convergence = longitude difference x sin(latitude), to first order
    angle = np.radians(0.6) * np.sin(np.radians(40.7))
    assert spread[0, 0, 1] == pytest.approx(-3 * k2 * np.cos(angle) * np.sin(angle), rel=1e-3)
    assert np.trace(spread[0]) == pytest.approx(14.0, rel=1e-3)


def test_a_missing_geoid_grid_is_an_error_and_no_silent_shift() -> None:
    pyproj = pytest.importorskip("pyproj")
    if pyproj.network.is_network_enabled():
        pytest.skip("grids may be fetched")
    target = Frame("heights", ("east", "north", "up"), "EPSG:32650", "EPSG:5773")
    try:
        converted, _ = convert(np.array([[40.7, 116.4, 100.0]]), np.zeros((1, 3, 3)), WGS, target)
    except InputError as error:
        message = str(error)
        told = (
            "from frame wgs to heights: the grid us_nga_egm96_15.tif is not there",
            "get https://cdn.proj.org/us_nga",
        )
    else:
        message, told = "" if abs(converted[0, 2] - 100.0) > 1.0 else "height unchanged", ("",)
    assert "unchanged" not in message
    assert all(words in message for words in told)


# Heights above sea level in map and tangent frames.

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
