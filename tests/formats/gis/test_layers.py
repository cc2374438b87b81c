"""Layers for a GIS: footprints and ellipses by hand, the GeoPackage as its standard says, GeoJSON at a known place."""

from __future__ import annotations

import json
import sqlite3
import struct
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from aatri.artifacts.block import Block, Frames
from aatri.artifacts.builder import block_of
from aatri.codes import APPROXIMATE, CHECK, CONTROL
from aatri.errors import AatriError
from aatri.formats.gis.geojson import write_geojson
from aatri.formats.gis.geopackage import write_geopackage
from aatri.formats.gis.layers import Layer, ellipse, layers_of
from aatri.formats.results.oriented_block import OrientedBlock
from tests.formats.start_solution import start_solution

BESIDE = [0.01, 0.02, -0.03]


def made_block(crs: str = "EPSG:32632", east: float = 500_000.0, north: float = 0.0) -> Block:
    """A strip of two images, 100 m above three points on a level, the first on the equator and a central meridian."""
    xyz = np.add([[0.0, 0.0, 10.0], [20.0, 5.0, 10.0], [10.0, -5.0, 10.0]], [east, north, 0.0])
    frames = Frames.of(id="map", axes="east,north,up" if crs != "local" else "x,y,z", crs=crs, vertical="")
    return block_of(
        name="made",
        cameras={
            "id": "cam",
            "pixel_size_mm": 0.005,
            "pixel_origin": "top-left-corner",
            "pixel_y": "down",
            "format": np.array([[4000.0, 3000.0]]),
            "principal_distance_mm": 20.0,
        },
        images={"id": ["i1", "i2"], "camera": "cam", "strip": "S", "sequence": [1.0, 2.0]},
        image_points={
            "image": ["i1", "i1", "i2"],
            "point": ["A", "B", "A"],
            "sigma_mm": 0.002,
            "xy": [[2000.0, 1500.0], [2800.0, 1300.0], [1200.0, 1500.0]],
        },
        ground_points={
            "point": ["A", "B", "T"],
            "xyz_m": xyz,
            "sigma_m": 0.02,
            "role": [[CONTROL] * 3, [CHECK] * 3, [APPROXIMATE] * 3],
        },
        exterior={
            "image": ["i1", "i2"],
            "position_m": [[east, north, 110.0], [east + 20, north, 110.0]],
            "angles_rad": np.zeros((2, 3)),
        },
        frames=frames,
    )


def oriented(crs: str = "EPSG:32632") -> OrientedBlock:
    """With a solution that is 1, 2, -3 cm beside the given coordinates, and covariances."""
    block = made_block(crs)
    solution = start_solution(block)
    n = len(block.points)
    covariance = np.zeros((n, 3, 3)) + np.diag([4e-4, 1e-4, 9e-4])
    points = replace(solution.points, xyz_m=np.add(solution.points.xyz_m, BESIDE), covariance_m2=covariance)
    return OrientedBlock(block, replace(solution, points=points))


def layer(made: OrientedBlock, name: str) -> Layer:
    return next(of for of in layers_of(made) if of.name == name)


def row(of: Layer, k: int = 0) -> dict[str, object]:
    return dict(zip(of.fields, of.rows[k]))


@pytest.mark.parametrize(
    ("variance", "turn_deg", "expected"),
    [((4.0, 1.0), 0.0, (2.0, 1.0, 90.0)), ((1.0, 4.0), 0.0, (2.0, 1.0, 0.0)), ((9.0, 1.0), 30.0, (3.0, 1.0, 60.0))],
)
def test_an_ellipse_has_the_axes_and_the_azimuth_of_its_covariance(
    variance: tuple[float, float], turn_deg: float, expected: tuple[float, float, float]
) -> None:
    """Turned by 30 degrees counterclockwise the long axis goes from east to an azimuth of 60 degrees."""
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    np.testing.assert_allclose(ellipse(turn @ np.diag([*variance, 5.0]) @ turn.T), expected, atol=1e-12)


def test_a_footprint_is_the_image_on_the_level_of_the_points() -> None:
    """f = 4000 px, 100.03 m above the points: 4000 x 3000 px are 100.03 x 75.0225 m, a pixel 0.0250075 m."""
    of = layer(oriented(), "footprints")
    shape = of.shapes[0]
    np.testing.assert_array_equal(shape[0], shape[-1])
    np.testing.assert_allclose(np.ptp(shape, axis=0), [100.03, 75.0225, 0.0], atol=1e-9)
    np.testing.assert_allclose((shape.min(axis=0) + shape.max(axis=0))[:2] / 2, [500_000.0, 0.0], atol=1e-9)
    assert row(of)["gsd_m"] == pytest.approx(0.0250075)


def test_an_image_that_sees_the_horizon_has_no_footprint() -> None:
    made = oriented()
    tilted = replace(made.block.exterior, angles_rad=np.array([[1.3, 0.0, 0.0], [0.0, 0.0, 0.0]]))
    of = layer(OrientedBlock(replace(made.block, exterior=tilted)), "footprints")
    assert [values[0] for values in of.rows] == ["i2"]


def test_control_has_its_residuals_and_ellipses_are_enlarged_by_what_they_say() -> None:
    made = oriented()
    control = layer(made, "control")
    assert [values[:3] for values in control.rows] == [("A", "control", "XYZ"), ("B", "check", "XYZ")]
    assert [row(control)[name] for name in ("vX_m", "vY_m", "vZ_m")] == pytest.approx([0.01, 0.02, -0.03])
    of = layer(made, "ellipses")
    values = row(of)
    assert (values["a_m"], values["b_m"], values["azimuth_deg"]) == pytest.approx((0.02, 0.01, 90.0))
    factor = values["factor"]
    assert isinstance(factor, float)
    np.testing.assert_allclose(np.ptp(of.shapes[0], axis=0)[:2], [2 * 0.02 * factor, 2 * 0.01 * factor])


def test_without_a_solution_there_are_no_residuals_and_no_ellipses() -> None:
    made = OrientedBlock(made_block())
    assert "ellipses" not in {of.name for of in layers_of(made)}
    assert row(layer(made, "control"))["vX_m"] is None
    assert row(layer(made, "points"))["sX_m"] is None


@pytest.mark.parametrize(("crs", "srs"), [("EPSG:32632", 32632), ("local", -1)])
def test_the_geopackage_is_as_its_standard_says(tmp_path: Path, crs: str, srs: int) -> None:
    write_geopackage(oriented(crs), tmp_path)
    database = sqlite3.connect(tmp_path / "block.gpkg")
    assert database.execute("PRAGMA application_id").fetchone() == (0x47504B47,)
    assert database.execute("PRAGMA integrity_check").fetchone() == ("ok",)
    tables = dict(database.execute("SELECT table_name, geometry_type_name FROM gpkg_geometry_columns"))
    assert tables == {
        "footprints": "POLYGON",
        "strips": "LINESTRING",
        "ellipses": "POLYGON",
        "points": "POINT",
        "images": "POINT",
        "control": "POINT",
    }
    assert {row[0] for row in database.execute("SELECT DISTINCT srs_id FROM gpkg_geometry_columns")} == {srs}
    assert {-1, 0, 4326, srs} == {row[0] for row in database.execute("SELECT srs_id FROM gpkg_spatial_ref_sys")}
    geometry, name = database.execute("SELECT geom, image FROM images").fetchone()
    assert (geometry[:4], name) == (b"GP\0\x01", "i1")
    assert struct.unpack("<iBI3d", geometry[4:]) == (srs, 1, 1001, 500_000.0, 0.0, 110.0)
    line = database.execute("SELECT geom FROM strips").fetchone()[0]
    assert struct.unpack("<iBII6d", line[4:])[2:] == (1002, 2, 500_000.0, 0.0, 110.0, 500_020.0, 0.0, 110.0)
    styles = dict(database.execute("SELECT f_table_name, styleQML FROM layer_styles WHERE useAsDefault = 1"))
    assert styles.keys() == tables.keys()
    assert {ET.fromstring(text).tag for text in styles.values()} == {"qgis"}
    assert ET.fromstring(styles["control"]).find("renderer-v2/symbols/symbol/layer").get("class") == "SimpleMarker"
    database.close()


def test_gdal_opens_the_geopackage(tmp_path: Path) -> None:
    pyogrio = pytest.importorskip("pyogrio")
    write_geopackage(oriented(), tmp_path)
    path = tmp_path / "block.gpkg"
    assert {name for name, kind in pyogrio.list_layers(path) if kind} >= {"images", "footprints", "points", "control"}
    info = pyogrio.read_info(path, layer="control")
    assert info["features"] == 2
    assert info["crs"] == "EPSG:32632"


def test_geojson_is_at_its_longitude_and_latitude(tmp_path: Path) -> None:
    """East 500 000, north 0 of zone 32 is 9 degrees east on the equator; a degree of latitude has 110.574 km."""
    write_geojson(oriented(), tmp_path)
    features = json.loads((tmp_path / "images.geojson").read_text())["features"]
    assert features[0]["geometry"] == {"type": "Point", "coordinates": [9.0, 0.0, 110.0]}
    assert features[0]["properties"]["image"] == "i1"
    (outline,) = json.loads((tmp_path / "footprints.geojson").read_text())["features"][0]["geometry"]["coordinates"]
    ring = np.array(outline)[:, :2]
    x, y = ring.T
    assert float(x[:-1] @ y[1:] - x[1:] @ y[:-1]) > 0  # counterclockwise
    assert np.ptp(y) * 110_574.0 * 0.9996 == pytest.approx(75.02, abs=0.1)


def test_a_local_block_has_no_longitude(tmp_path: Path) -> None:
    with pytest.raises(AatriError, match="declares no coordinate system"):
        write_geojson(oriented("local"), tmp_path / "out")
    assert not (tmp_path / "out").exists()
