"""Blocks whose first frame is in latitude, longitude and height: the same block as in a map."""

from __future__ import annotations

import csv
import math
import re
from pathlib import Path

import numpy as np
import pyproj
import pytest

from aatri.artifacts.offers import offers_of
from aatri.errors import AatriError
from aatri.formats.tables.writer import write_block
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.interior_orientation.calibrated import calibrated
from aatri.tables.digest import content_digest
from tests.formats.tables.block_folder import replaced, write_folder
from tests.reading import read_block
from tests.stages.geodetic_blocks import made

IMU = {"imu": {"observed": True, "rotation": "roll-pitch-heading"}}
SURVEY = {"survey": {"distances": 6, "zenith_angles": 6, "direction_sets": 2, "height_differences": 4}}


def _geographic(folder: Path, name: str) -> None:
    """Coordinates of a table as latitude, longitude, height; standard deviations are in metres as they were."""
    path = folder / name
    with path.open() as file:
        rows = list(csv.DictReader(file))
    to = pyproj.Transformer.from_crs("EPSG:32650", "EPSG:4326", always_xy=True)
    for row in rows:
        if row["X"] and row["Y"]:
            longitude, latitude = to.transform(float(row["X"]), float(row["Y"]))
            row["X"], row["Y"] = repr(latitude), repr(longitude)
            row["sX"], row["sY"] = row["sY"], row["sX"]
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def _as_geographic(folder: Path) -> None:
    text = (folder / "block.yaml").read_text()
    at = text.index("frames:")
    rest = text[at:].split("\n", 1)[1]
    tail = re.sub(r"\A(?:[ ]+.*\n)+", "", rest)
    own = "frames:\n  wgs: {axes: [latitude, longitude, height], crs: EPSG:4979}\n"
    (folder / "block.yaml").write_text(text[:at] + own + tail)
    for name in ("ground_points.csv", "exterior.csv"):
        _geographic(folder, name)


@pytest.mark.slow
def test_a_geographic_block_is_that_of_the_map(tmp_path: Path) -> None:
    known = {"known": {"full": 4, "plan": 2, "height": 3, "check_full": 3}}
    block = made(2, 1000.0, **(IMU | SURVEY | known))
    folder = tmp_path / "block"
    write_block(block, folder)
    _as_geographic(folder)
    read = read_block(folder)
    assert read.frames.id.tolist() == ["utm50n", "wgs"]
    assert read.frames.crs[0] == "EPSG:32650"
    assert read.earth_curvature == "frame"
    np.testing.assert_array_equal(read.ground_points.role, block.ground_points.role)
    np.testing.assert_allclose(read.ground_points.xyz_m, block.ground_points.xyz_m, atol=2e-6)
    scale = read.ground_points.covariance_m2[0, 0, 0] / block.ground_points.covariance_m2[0, 0, 0]
    assert scale == pytest.approx(0.9996**2, rel=1e-4)  # metres of the ground in the map
    results = [bundle(b, calibrated(b), options=BundleOptions(blunders="none")) for b in (block, read)]
    sigma = np.sqrt(np.einsum("nii->ni", results[0].points.covariance_m2))
    away = (results[0].points.xyz_m - results[1].points.xyz_m) / sigma
    assert np.nanmax(np.abs(away)) < 0.02  # the standard deviations differ by the scale of the map, 0.4 of a thousandth
    write_block(read, tmp_path / "again")
    assert content_digest(read_block(tmp_path / "again")) == content_digest(read)


def test_what_is_counted_in_axes_is_refused_by_name(tmp_path: Path) -> None:
    block = made(
        2,
        1000.0,
        survey={"azimuths": 2, "map_distances": 2, "baselines": 1, "relative": {"coordinate_difference": 3}},
        **IMU,
    )
    folder = tmp_path / "block"
    write_block(block, folder)
    _as_geographic(folder)
    with pytest.raises(AatriError) as error:
        read_block(folder)
    text = str(error.value)
    for part in ("azimuth", "dX", "dY", "reduced to a map", "axis of the first frame"):
        assert part in text
    assert "dZ" not in text


def test_observed_angles_against_a_frame_in_degrees_are_refused(tmp_path: Path) -> None:
    folder = tmp_path / "block"
    write_block(made(2, 1000.0, imu={"observed": True}), folder)
    _as_geographic(folder)
    with pytest.raises(AatriError, match="roll, pitch and heading"):
        read_block(folder)


@pytest.mark.parametrize(("crs", "zone"), [("EPSG:4979", "EPSG:32755"), ("EPSG:4490", ""), ("EPSG:4937", "")])
def test_the_map_is_the_utm_zone_on_the_datum(crs: str, zone: str) -> None:
    from aatri.frames.conversion import Frame, crs_of
    from aatri.frames.own_map import utm_of

    frame = Frame("g", ("latitude", "longitude", "height"), crs)
    own = utm_of(frame, -35.0, 149.0)
    assert own.name == "utm55s"
    assert zone in ("", own.crs)
    assert crs_of(own).geodetic_crs.datum.name == crs_of(frame).geodetic_crs.datum.name


def test_the_map_of_a_sphere_is_its_transverse_mercator() -> None:
    """x = R / 2 ln((1 + B) / (1 - B)), y = R atan(tan phi / cos dlambda), B = cos phi sin dlambda (Snyder)."""
    from aatri.frames.conversion import Frame, convert
    from aatri.frames.own_map import utm_of

    mars = Frame("g", ("longitude", "latitude", "height"), "+proj=longlat +R=3396190 +no_defs +type=crs")
    place = np.array([[136.4, -4.5, -2700.0]])
    own = utm_of(mars, place[0, 1], place[0, 0])
    phi, off = math.radians(-4.5), math.radians(136.4 - 135.0)
    B = math.cos(phi) * math.sin(off)
    x, y = 3396190 / 2 * math.log((1 + B) / (1 - B)), 3396190 * math.atan(math.tan(phi) / math.cos(off))
    moved, _ = convert(place, np.zeros((1, 3, 3)), mars, own)
    np.testing.assert_allclose(moved, [[5e5 + x, y, -2700.0]], atol=1e-4)


@pytest.mark.parametrize("vertical", ["", ", vertical: EPSG:5773"])
def test_ellipsoidal_positions_beside_an_undulation_are_levelled_by_it(tmp_path: Path, vertical: str) -> None:
    """h = H + N, with and without a geoid whose grid is not installed; the plan is pyproj's."""
    folder = write_folder(
        tmp_path / "block",
        replaced(
            "block.yaml",
            "crs: EPSG:32650}",
            f"""\
crs: EPSG:32650{vertical}}}
  wgs: {{axes: [latitude, longitude, height], crs: EPSG:4979}}
undulation: -9.5""",
        ),
    )
    (folder / "exterior.csv").write_text("image,X,Y,Z,sX,sY,sZ,frame\na1,40.7,116.4,390.0,1,1,1,wgs\n")
    block = read_block(folder)
    east, north = pyproj.Transformer.from_crs("EPSG:4326", "EPSG:32650", always_xy=True).transform(116.4, 40.7)
    np.testing.assert_allclose(block.exterior.position_m, [[east, north, 399.5]], atol=1e-6)
    assert not any(offer.name == "undulation:without_effect" for offer in offers_of(block))
