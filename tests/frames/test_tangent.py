"""The tangent frame: there and back, against PROJ's own topocentric frame, derivatives against a map in closed form."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
import pytest

from aatri.errors import InputError
from aatri.frames.conversion import Frame
from aatri.frames.ellipsoid import Ellipsoid, geocentric, geographic, normal_and_height
from aatri.frames.expanded import Expanded
from aatri.frames.tangent import TangentFrame, tangent_frame
from tests.complex_step import complex_step

AXES = ("east", "north", "up")
CENTRE = np.array([446_000.0, 4_505_000.0, 0.0])
WGS84 = Ellipsoid(6378137.0, 0.0066943799901413165)

MAPS = {
    "transverse Mercator": ("EPSG:32650", CENTRE),
    "Gauss-Krueger": ("EPSG:4548", np.array([548_000.0, 4_505_000.0, 0.0])),
    "Lambert": ("EPSG:2154", np.array([700_000.0, 6_600_000.0, 0.0])),
    "Mercator": ("EPSG:3857", np.array([1_000_000.0, 6_000_000.0, 0.0])),
    "stereographic": ("EPSG:3031", np.array([1_000_000.0, 500_000.0, 0.0])),
    "Krovak": ("EPSG:5514", np.array([-700_000.0, -1_050_000.0, 0.0])),
}


def utm() -> TangentFrame:
    """A tangent frame in UTM zone 50."""
    return tangent_frame(Frame("map", AXES, "EPSG:32650"), CENTRE)


def places(n: int, half: tuple[float, float, float] = (30_000.0, 30_000.0, 4_000.0)) -> Any:
    return np.random.default_rng(3).uniform(-1, 1, (n, 3)) * half


@pytest.mark.parametrize("name", MAPS)
def test_coordinates_and_covariances_return_through_every_supported_frame(name: str) -> None:
    crs, centre = MAPS[name]
    frame = tangent_frame(Frame("map", AXES, crs), centre)
    xyz = centre + places(50)
    X = frame.from_block(xyz)
    np.testing.assert_allclose(frame.to_block(X), xyz, rtol=0, atol=1e-6)
    D = frame.derivatives_at(X)
    C = np.diag([1.0, 4.0, 9.0]) * 1e-4
    inside = np.linalg.inv(D) @ C @ np.linalg.inv(D).swapaxes(1, 2)
    np.testing.assert_allclose(D @ inside @ D.swapaxes(1, 2), np.broadcast_to(C, D.shape), atol=1e-15)
    # an independent conversion: lengths between places are those of their geocentric coordinates
    to = pyproj.Transformer.from_crs(pyproj.CRS(crs).to_3d(), pyproj.CRS(crs).geodetic_crs.to_3d(), always_xy=True)
    size = pyproj.CRS(crs).ellipsoid
    cart = pyproj.Transformer.from_pipeline(
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step +proj=cart "
        f"+a={size.semi_major_metre!r} +rf={size.inverse_flattening!r}"
    )
    G = np.stack(cart.transform(*to.transform(*xyz.T)), axis=1)
    np.testing.assert_allclose(
        np.linalg.norm(np.diff(X, axis=0), axis=1), np.linalg.norm(np.diff(G, axis=0), axis=1), rtol=0, atol=1e-6
    )


def test_geocentric_blocks_return_exactly_and_have_the_same_axes_everywhere() -> None:
    centre = geocentric(np.array([[116.0, 40.0, 50.0]]), WGS84)[0]
    frame = tangent_frame(Frame("g", ("x", "y", "z"), "EPSG:4978"), centre)
    xyz = centre + places(20)
    X = frame.from_block(xyz)
    np.testing.assert_allclose(frame.to_block(X), xyz, rtol=0, atol=1e-8)
    np.testing.assert_allclose(frame.up_at(np.zeros((1, 3)))[0], [0, 0, 1], atol=1e-14)
    np.testing.assert_array_equal(frame.axes_at(X), np.broadcast_to(frame.axes.T, (20, 3, 3)))


def test_it_is_the_topocentric_frame_of_proj_turned_to_the_grid() -> None:
    frame, xyz = utm(), CENTRE + places(100)
    to = pyproj.Transformer.from_crs(pyproj.CRS("EPSG:32650").to_3d(), "EPSG:4979", always_xy=True)
    longitude, latitude, h = to.transform(*CENTRE)
    topocentric = pyproj.Transformer.from_pipeline(
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step +proj=cart +ellps=WGS84 "
        f"+step +proj=topocentric +ellps=WGS84 +lon_0={longitude!r} +lat_0={latitude!r} +h_0={h!r}"
    )
    expected = np.stack(topocentric.transform(*to.transform(*xyz.T)), axis=1)
    angle = np.radians(pyproj.Proj("EPSG:32650").get_factors(longitude, latitude).meridian_convergence)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
    np.testing.assert_allclose(frame.from_block(xyz), expected @ turn.T, rtol=0, atol=1e-4)  # PROJ's angle: 1e-9


def test_grid_and_true_north_differ_by_the_meridian_convergence() -> None:
    frame, X = utm(), places(20)
    xyz = frame.to_block(X)
    longitude, latitude = pyproj.Proj("EPSG:32650")(xyz[:, 0], xyz[:, 1], inverse=True)
    grid, true = frame.axes_at(X), frame.true_axes_at(X)
    north = np.einsum("nji,nj->ni", true, grid[:, :, 1])
    expected = pyproj.Proj("EPSG:32650").get_factors(longitude, latitude).meridian_convergence
    np.testing.assert_allclose(np.degrees(np.arctan2(north[:, 0], north[:, 1])), expected, atol=1e-5)
    np.testing.assert_allclose(grid[:, :, 2], true[:, :, 2], atol=1e-15)


def test_the_height_and_the_normal_are_those_of_the_ellipsoid_up_to_its_poles() -> None:
    rng = np.random.default_rng(1)
    place = np.column_stack([rng.uniform(-180, 180, 500), rng.uniform(-90, 90, 500), rng.uniform(-9e3, 1e6, 500)])
    place[:2, 1] = 90.0, -90.0
    G = geocentric(place, WGS84)
    expected = np.stack(pyproj.Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True).transform(*place.T), 1)
    np.testing.assert_allclose(G, expected, rtol=0, atol=1e-8)
    back = geographic(G, WGS84)
    np.testing.assert_allclose(back[:, 1:], place[:, 1:], rtol=0, atol=2e-8)
    normal, h = normal_and_height(G, WGS84)
    np.testing.assert_allclose(geocentric(place - [0, 0, 1], WGS84) + normal, G, rtol=0, atol=1e-8)
    np.testing.assert_allclose(h, place[:, 2], rtol=0, atol=1e-8)


def krueger(G: Any, central_deg: float = 117.0) -> Any:
    """East, north and height in UTM of geocentric coordinates, by Krueger's series in closed form; also complex."""
    normal, h = normal_and_height(G, WGS84)
    e = np.sqrt(WGS84.e2)
    sine = normal[:, 2]
    cosine = np.sqrt(1 - sine**2)
    p = np.sqrt(G[:, 0] ** 2 + G[:, 1] ** 2)
    c0, s0 = np.cos(np.radians(central_deg)), np.sin(np.radians(central_deg))
    cl, sl = (G[:, 0] * c0 + G[:, 1] * s0) / p, (G[:, 1] * c0 - G[:, 0] * s0) / p
    t = np.sinh(np.arctanh(sine) - e * np.arctanh(e * sine))
    xi, eta = np.arctan(t / cl), np.arctanh(sl / np.sqrt(1 + t**2))
    f = 1 - np.sqrt(1 - WGS84.e2)
    n = f / (2 - f)
    A = WGS84.a_m / (1 + n) * (1 + n**2 / 4 + n**4 / 64)
    alpha = (
        n / 2 - 2 / 3 * n**2 + 5 / 16 * n**3 + 41 / 180 * n**4,
        13 / 48 * n**2 - 3 / 5 * n**3 + 557 / 1440 * n**4,
        61 / 240 * n**3 - 103 / 140 * n**4,
        49561 / 161280 * n**4,
    )
    north, east = xi + 0 * cosine, eta + 0 * cosine
    for j, a in enumerate(alpha, 1):
        north = north + a * np.sin(2 * j * xi) * np.cosh(2 * j * eta)
        east = east + a * np.cos(2 * j * xi) * np.sinh(2 * j * eta)
    return np.stack([500_000.0 + 0.9996 * A * east, 0.9996 * A * north, h], axis=1)


def test_derivatives_of_the_map_are_those_of_its_closed_form_by_complex_step() -> None:
    frame, X = utm(), places(5)
    np.testing.assert_allclose(krueger(X @ frame.axes.T + frame.origin_m), frame.to_block(X), rtol=0, atol=1e-6)
    for x in X:
        expected = complex_step(lambda z: krueger(z[None] @ frame.axes.T + frame.origin_m)[0], x)
        np.testing.assert_allclose(frame.derivatives_at(x[None])[0], expected, rtol=0, atol=2e-10)


def test_an_undulation_stands_for_the_geoid() -> None:
    plain = utm()
    raised = tangent_frame(Frame("map", AXES, "EPSG:32650"), CENTRE, undulation_m=-12.0)
    xyz = CENTRE + places(5)
    np.testing.assert_allclose(raised.to_block(raised.from_block(xyz)), xyz, rtol=0, atol=1e-6)
    lower = tangent_frame(Frame("map", AXES, "EPSG:32650"), CENTRE - [0, 0, 12.0])
    np.testing.assert_allclose(raised.from_block(xyz), lower.from_block(xyz - [0, 0, 12.0]), rtol=0, atol=1e-7)
    assert abs(plain.from_block(xyz) - raised.from_block(xyz)).max() > 1e-3


@pytest.fixture
def grids(tmp_path: Path) -> Iterator[Path]:
    """A folder in which PROJ looks for grids."""
    before = pyproj.datadir.get_data_dir()
    pyproj.datadir.append_data_dir(str(tmp_path))
    yield tmp_path
    pyproj.datadir.set_data_dir(before)


def test_a_geoid_grid_is_used_point_by_point(grids: Path) -> None:
    """A grid of constant slope: 5 m at 116 degrees of longitude, 1 m more per degree."""
    grid = np.repeat(5.0 + np.arange(-1, 3)[None] * 1.0, 4, axis=0).astype(">f4")
    head = np.array([38.0, 115.0, 1.0, 1.0], dtype=">f8").tobytes() + np.array([4, 4], dtype=">i4").tobytes()
    (grids / "slope.gtx").write_bytes(head + grid.tobytes())
    crs = "+proj=utm +zone=50 +datum=WGS84 +geoidgrids=slope.gtx +vunits=m +type=crs"
    frame = tangent_frame(Frame("map", AXES, crs), CENTRE)
    xyz = CENTRE + places(20, (20_000.0, 20_000.0, 500.0))
    X = frame.from_block(xyz)
    np.testing.assert_allclose(frame.to_block(X), xyz, rtol=0, atol=1e-6)
    longitude, _ = pyproj.Proj("EPSG:32650")(xyz[:, 0], xyz[:, 1], inverse=True)
    np.testing.assert_allclose(frame.height_at(X), xyz[:, 2] + 5.0 + (np.asarray(longitude) - 116.0), atol=1e-5)


def test_a_grid_that_is_not_there_is_named() -> None:
    if pyproj.network.is_network_enabled():
        pytest.skip("grids may be fetched")
    with pytest.raises(InputError, match="tif"):
        tangent_frame(Frame("map", AXES, "EPSG:32650", "EPSG:5773"), CENTRE)


def test_a_place_the_map_does_not_have_is_nan_and_no_error() -> None:
    frame = utm()
    assert not np.isfinite(frame.from_block(np.array([[1e12, 1e12, 0.0]]))).all()
    assert np.isnan(frame.to_block(np.array([[np.nan, 0.0, 0.0]]))).all()


@pytest.mark.parametrize("away_m", [1e7, 1e12, 1e17, 1e30])
def test_axes_where_the_map_ends_are_nan_and_no_error(away_m: float) -> None:
    """There an iteration may arrive that runs away: every coordinate is the same within rounding."""
    far = np.array([[away_m, 0.0, 0.0], [0.0, away_m, -away_m], [0.0, 0.0, away_m]])
    axes = utm().axes_at(far)
    known = np.isfinite(axes).all(axis=(1, 2))
    np.testing.assert_allclose(
        axes[known] @ axes[known].swapaxes(1, 2), np.tile(np.eye(3), (known.sum(), 1, 1)), atol=1e-9
    )


def test_expansions_are_the_map_and_its_axes_and_smooth() -> None:
    frame, X = utm(), places(30)
    expanded = Expanded(frame, CENTRE)
    x, D = expanded.coordinates(X)
    np.testing.assert_allclose(x + CENTRE, frame.to_block(X), rtol=0, atol=1e-8)
    np.testing.assert_allclose(D, frame.derivatives_at(X), rtol=0, atol=1e-9)
    B, dB = expanded.axes(X)
    np.testing.assert_allclose(B.swapaxes(1, 2), frame.axes_at(X), rtol=0, atol=5e-10)
    for k in range(3):
        np.testing.assert_allclose(complex_step(lambda z: expanded.coordinates(z[None])[0][0], X[k]), D[k], atol=1e-12)
        turned = complex_step(lambda z: expanded.axes(z[None])[0][0], X[k]).reshape(3, 3, 3)
        np.testing.assert_allclose(turned, dB[k], atol=1e-14)
    steps = np.arange(20)[:, None] * np.array([1e-6, 2e-6, 1e-6]) + np.array([7.0, 8.0, 9.0])
    near = np.diff(expanded.coordinates(steps)[0], axis=0)
    assert np.abs(near - near[0]).max() < 1e-13  # the map itself rounds to 1e-9
    assert np.isnan(expanded.coordinates(np.full((1, 3), np.nan))[0]).all()
