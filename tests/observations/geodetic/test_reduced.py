"""Distances reduced to map and ellipsoid: values by PROJ, derivatives by complex step, what a map does to others."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pyproj
import pytest

from aatri.artifacts.block import Block
from aatri.errors import InputError
from aatri.frames.conversion import Frame
from aatri.frames.tangent import tangent_frame
from aatri.observations.geodetic.reduced import in_map, on_ellipsoid
from aatri.observations.level import tangent_level
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.complex_step import complex_step
from tests.stages.film_blocks import Told
from tests.stages.geodetic_blocks import figures, made

MAP = Frame("map", ("east", "north", "up"), "EPSG:32650")
ORIGIN = np.array([503_000.0, 4_505_000.0, 0.0])
FRAME = tangent_frame(MAP, ORIGIN)
RNG = np.random.default_rng(5)
PLACES = ORIGIN + RNG.uniform(-4000, 4000, (8, 3)) * [1, 1, 0.1] + [0, 0, 600.0]


def test_distances_are_the_geodesics_of_proj() -> None:
    between, arc = on_ellipsoid(FRAME, np.zeros(3))
    X = FRAME.from_block(PLACES)
    line, _, _ = between(None, X[:4], X[4:], None, None)  # type: ignore[arg-type]
    found, _ = arc(line)
    to = pyproj.Transformer.from_crs("EPSG:32650", "EPSG:4326", always_xy=True)
    places = np.stack(to.transform(PLACES[:, 0], PLACES[:, 1]), axis=1)
    expected = pyproj.Geod(ellps="WGS84").inv(*places[:4].T, *places[4:].T)[2]
    np.testing.assert_allclose(found, expected, atol=1e-5)


def test_derivatives_on_the_ellipsoid_are_those_of_the_complex_step() -> None:
    origin = np.array([10.0, -20.0, 500.0])
    between, arc = on_ellipsoid(FRAME, origin)
    X = FRAME.from_block(PLACES) - origin

    def f(z: Any) -> Any:
        feet = []
        for x in (z[:3] + origin, z[3:] + origin):
            feet.append(x - FRAME.height_at(x[None])[0] * FRAME.up_at(x[None])[0])
        line = feet[1] - feet[0]
        chord = np.sqrt((line**2).sum())
        return np.asarray(2 * R * np.arcsin(chord / (2 * R)))[None]

    a, e2 = FRAME.body.a_m, FRAME.body.e2
    sine = FRAME.up_at(origin[None])[0] @ FRAME.axes[2]
    R = a * np.sqrt(1 - e2) / (1 - e2 * sine**2)
    line, by_start, by_end = between(None, X[:4], X[4:], None, None)  # type: ignore[arg-type]
    value, by_line = arc(line)
    for k in range(4):
        z = np.concatenate([X[k], X[k + 4]])
        np.testing.assert_allclose(value[k], f(z)[0], rtol=1e-12)
        J = np.concatenate([by_line[k] @ by_start[k], by_line[k] @ by_end[k]])
        np.testing.assert_allclose(J, complex_step(f, z)[0], atol=1e-10)


def test_lines_in_the_map_are_differences_of_its_coordinates() -> None:
    origin = np.array([0.0, 0.0, 300.0])
    level = tangent_level(FRAME, origin)
    X = FRAME.from_block(PLACES) - origin
    line, by_start, by_end = in_map(level, X[:4], X[4:], np.zeros(4), np.zeros(4))
    expected = (PLACES[4:] - PLACES[:4]) * [1, 1, 0]
    np.testing.assert_allclose(line, expected, atol=1e-6)
    for k in range(3):
        step = np.eye(3)[k] * 10.0
        ahead = in_map(level, X[:4], X[4:] + step, np.zeros(4), np.zeros(4))[0]
        back = in_map(level, X[:4], X[4:] - step, np.zeros(4), np.zeros(4))[0]
        np.testing.assert_allclose((ahead - back) / 20.0, by_end[:, :, k], atol=1e-8)
    assert by_start.shape == by_end.shape


SURVEY = {
    "survey": {"distances": 10, "map_distances": 10, "ellipsoid_distances": 10},
    "gnss": {"observed": False},
    "noise": {"factor": 0.0, "image_um": 2.0, "control_m": (0.01, 0.01, 0.01)},
}


def _network(block: Block, told: Told | None = None) -> Any:
    return bundle(block, calibrated(block), options=BundleOptions(blunders="none"), context=told or Told())


def test_a_block_with_distances_of_all_reductions_is_without_error_where_they_have_none() -> None:
    block, told = made(1, 1000.0, **SURVEY), Told()
    assert figures(block, _network(block, told))["truth_rmse_z_m"] < 2e-4
    assert not any("not reduced" in text for text in told.warnings)


def test_in_a_map_distances_that_are_not_reduced_are_named() -> None:
    block, told = replace(made(1, 1000.0, **SURVEY), earth_curvature="correct"), Told()
    _network(block, told)
    (text,) = [text for text in told.warnings if "not reduced" in text]
    assert "10 distances are not reduced" in text
    assert "0.9995" in text or "0.9994" in text
    reduced, told = replace(block, geodetic=block.geodetic.take(block.geodetic.reduced != "no")), Told()
    solution = _network(reduced, told)
    assert not any("not reduced" in text for text in told.warnings)
    mine = solution.residuals.kind == "horizontal_distance"
    assert np.abs(solution.residuals.residual[mine, 0]).max() < 3e-3  # the ground's relief is left in the map's images


def test_a_distance_reduced_to_a_map_that_is_none_is_refused() -> None:
    from tests.stages.bundle_adjustment.test_tangent_frame import _in_geocentric_axes

    block = _in_geocentric_axes(made(1, 1000.0, **SURVEY))
    with pytest.raises(InputError, match="first frame is none"):
        _network(block)
