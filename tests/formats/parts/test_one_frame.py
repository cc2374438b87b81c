"""Sources in different frames: places, covariances and rotations in that of the block; what has no place there."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pyproj
import pytest

from aatri.codes import CONTROL, NO_ROLE
from aatri.errors import InputError
from aatri.formats.parts.block_parts import LOCAL, PLANE
from aatri.formats.parts.one_frame import block_frame, in_frame
from aatri.frames.conversion import Frame
from aatri.progress import SILENT
from tests.formats.parts.made_parts import ground, positions
from tests.formats.parts.test_joined import Heard

UTM = Frame("map", ("east", "north", "up"), "EPSG:32632")
DEGREES = Frame("wgs", ("longitude", "latitude", "height"), "EPSG:4979")


def test_rotations_turn_by_the_convergence_of_the_map() -> None:
    """An image with its x axis to true east, 8.0 deg east and 47 north: grid east is turned by (lon - 9) sin(lat)."""
    parts = replace(positions("a.txt", "a", ground_from_image=[np.eye(3).tolist()]), frame=DEGREES)
    parts.exterior = {**parts.exterior, "position_m": [[8.0, 47.0, 500.0]]}
    moved = in_frame(parts, UTM, SILENT).exterior
    R = np.asarray(moved["ground_from_image"])[0]
    gamma = pyproj.Proj("EPSG:32632").get_factors(8.0, 47.0).meridian_convergence
    assert gamma == pytest.approx(-1.0 * math.sin(math.radians(47.0)), abs=1e-3)
    assert math.degrees(math.atan2(R[1, 0], R[0, 0])) == pytest.approx(gamma, abs=1e-6)
    east, north = pyproj.Transformer.from_crs("EPSG:4326", "EPSG:32632", always_xy=True).transform(8.0, 47.0)
    np.testing.assert_allclose(np.asarray(moved["position_m"])[0], [east, north, 500.0], rtol=0, atol=1e-6)


def test_standard_deviations_turn_with_the_axes() -> None:
    """Latitude first: its standard deviation is that of north."""
    north_first = Frame("wgs", ("latitude", "longitude", "height"), "EPSG:4979")
    parts = replace(ground("a.txt", "p", sigma_m=[[0.01, 0.05, 0.1]], role=CONTROL), frame=north_first)
    parts.ground_points = {**parts.ground_points, "xyz_m": [[47.0, 9.0, 500.0]]}
    covariance = np.asarray(in_frame(parts, UTM, SILENT).ground_points["covariance_m2"])[0]
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), [0.05, 0.01, 0.1], rtol=1e-3)


def test_plan_control_of_latitude_and_longitude_has_its_place_in_a_map() -> None:
    """At the height of the other point, 500 m; its own height stays unknown, its standard deviations stay."""
    parts = replace(ground("a.txt", "p", "q", sigma_m=[[0.01, 0.02, np.nan], [0.01, 0.02, 0.03]]), frame=DEGREES)
    role = [[CONTROL, CONTROL, NO_ROLE], [CONTROL] * 3]
    parts.ground_points = {**parts.ground_points, "xyz_m": [[8.0, 47.0, np.nan], [8.0, 47.0, 500.0]], "role": role}
    moved = in_frame(parts, UTM, SILENT).ground_points
    east, north = pyproj.Transformer.from_crs("EPSG:4326", "EPSG:32632", always_xy=True).transform(8.0, 47.0)
    np.testing.assert_allclose(np.asarray(moved["xyz_m"])[0], [east, north, np.nan], rtol=0, atol=1e-6)
    of_plan = np.asarray(moved["covariance_m2"])[:, :2, :2]
    np.testing.assert_allclose(of_plan[0], of_plan[1], rtol=1e-4, atol=1e-9)


def test_a_height_without_its_place_is_refused_in_another_frame() -> None:
    parts = replace(ground("a.txt", "p", role=[[NO_ROLE, NO_ROLE, CONTROL]]), frame=DEGREES)
    parts.ground_points = {**parts.ground_points, "xyz_m": [[np.nan, np.nan, 500.0]]}
    with pytest.raises(InputError, match=r"a.txt: 1 row has some coordinates alone"):
        in_frame(parts, UTM, SILENT)


def test_the_frame_is_that_of_control_before_positions_before_the_rest() -> None:
    start = replace(positions("start.txt", "a"), frame=Frame("m", ("east", "north", "up"), "EPSG:32633"))
    control = replace(ground("control.txt", "p", role=CONTROL), frame=UTM)
    assert block_frame([start, control], None) == UTM
    assert block_frame([start], None).crs == "EPSG:32633"
    assert block_frame([positions("plane.txt", "a")], None) == PLANE
    assert block_frame([replace(positions("free.txt", "a"), frame=LOCAL)], None) == LOCAL
    degrees = replace(control, frame=DEGREES)
    degrees.ground_points = {**degrees.ground_points, "xyz_m": [[121.5, 31.5, 10.0]]}
    assert block_frame([degrees], None).crs == "EPSG:32651"


def test_a_free_model_has_no_place_in_a_map_and_control_of_no_system_is_refused() -> None:
    heard = Heard()
    free = in_frame(replace(positions("free.txt", "a"), frame=LOCAL), UTM, heard)
    assert not free.exterior
    assert heard.logs == ["free.txt: a free model; its orientations and points are no start values here"]
    with pytest.raises(InputError, match=r"control.txt: its control or positions have no declared frame"):
        in_frame(ground("control.txt", "p", role=CONTROL), UTM, SILENT)


def test_orientations_in_metres_of_no_named_system_are_taken_to_be_in_that_of_the_block() -> None:
    heard = Heard()
    plane = in_frame(positions("list.opk", "a"), UTM, heard)
    assert plane.exterior["position_m"] == [[0.0, 1.0, 100.0]]
    assert heard.logs == ["list.opk: says no coordinate system; taken to be in EPSG:32632"]
