"""Rigs, mounts, lever arms, blocks without strips or images, full covariances of control: read, refused, written."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pyproj
import pytest

from aatri.artifacts.block import TRUTH, Block
from aatri.errors import AatriError
from aatri.formats.tables.writer import write_block
from aatri.tables.digest import content_digest
from tests.reading import read_block

YAML = """\
aatri_block: 1
name: rig
frames:
  map: {axes: [north, east, up], crs: EPSG:32650}
  geo: {axes: [latitude, longitude, height], crs: EPSG:4979}
undulation: -12.3
units: {ground: m, angle: deg, sigma_image: um, sigma_ground: cm, sigma_angle: deg}
rotation: roll-pitch-heading
heading: grid
sigma: {image: 2, control: [2, 3, 4], position: 5, attitude: 0.01}
cameras:
  down:
    kind: digital
    image_coordinates: pixel
    pixel: {size: 0.004, origin: top-left-corner, y: down}
    format: [6000, 4000]
    principal_distance: 50
    mount: 90
    lever_arm: [0.1, 0.2, -0.3]
    boresight: [0.1, 0, -0.2]
    sigmas: {lever_arm: [0.01, .inf, 0.0], boresight: .inf}
rigs:
  R: {nadir: {}, left: {position: [-0.1, 0, 0.02], angles: [0, -45, 0], \
sigmas: {position: 0.01, angles: [0.1, .inf, 0]}},
      aft: {angles: [30, 0, 0]}}
"""

TABLES = {
    "block.yaml": YAML,
    "images.csv": "image,camera,time,rig,member\nn1,down,1.5,R,nadir\nl1,down,1.5,R,left\nn2,down,2.5,R,nadir\n",
    "image_points.csv": "image,point,x,y\n"
    + "".join(f"{i},{p},{100 * k + 10},{200 * k + 20}\n" for i in ("n1", "l1", "n2") for k, p in enumerate("ABCD")),
    "ground_points.csv": "point,X,Y,Z,sX,sY,sZ\nB,200,20,3,2,2,2\nA,100,10,5,1,1,\nC,300,30,,,,\n",
    "covariances.csv": "table,row_a,coord_a,row_b,coord_b,value\n"
    "ground_points,B,X,A,Y,0.5\n"  # X is north: axis 1; Y is east: axis 0
    "ground_points,A,Z,A,Z,9\n"
    "ground_points,A,X,A,Y,0.25\n"
    "ground_points,A,X,B,X,1\n",
}

NETWORK = {
    "block.yaml": "aatri_block: 1\nframes: {f: {axes: [east, north, up]}}\n",
    "ground_points.csv": "point,X,Y,Z,sX,sY,sZ\nA,0,0,0,0,0,0\nB,,,,,,\n",
    "geodetic.csv": "type,from,to,value,sigma,h_from,h_to,reduced\ndistance,A,B,100,0.001,1.5,1.6,horizon\n",
}


def _folder(folder: Path, tables: dict[str, str], **changes: str | None) -> Path:
    folder.mkdir(exist_ok=True)
    for name, text in (tables | {f"{k.replace('__', '.')}": v for k, v in changes.items()}).items():
        if text is not None:
            (folder / name).write_text(text)
    return folder


def _same_again(block: Block, folder: Path) -> None:
    write_block(block, folder)
    assert content_digest(read_block(folder), without=TRUTH) == content_digest(block, without=TRUTH)


def test_rigs_mounts_and_sigmas_of_lever_arms_are_read_and_written(tmp_path: Path) -> None:
    block = read_block(_folder(tmp_path / "b", TABLES))
    rigs = block.rig_members
    assert rigs.member.tolist() == ["nadir", "aft", "left"]
    assert rigs.is_frame.tolist() == [True, False, False]
    np.testing.assert_allclose(rigs.position_m[2], [-0.1, 0, 0.02])
    np.testing.assert_allclose(np.degrees(rigs.angles_rad), [[0, 0, 0], [30, 0, 0], [0, -45, 0]])
    np.testing.assert_allclose(rigs.position_sigma_m[2], 0.01)
    np.testing.assert_allclose(rigs.angle_sigma_rad[2], [math.radians(0.1), np.nan, 0])
    assert rigs.angle_free.tolist() == [[False] * 3, [False] * 3, [False, True, False]]
    assert block.images.rig.tolist() == ["R"] * 3
    assert block.images.strip.tolist() == [-1] * 3
    assert block.cameras.mount_deg.tolist() == [90]
    assert (block.undulation_m, block.heading) == (-12.3, "grid")
    given = block.camera_parameters
    found = {n: (s, bool(f)) for n, s, f in zip(given.name.tolist(), given.sigma.tolist(), given.free)}
    assert found["lever_arm.x"] == (0.01, False)
    assert found["lever_arm.y"][1]
    assert found["lever_arm.z"] == (0.0, False)
    assert all(found[f"boresight.{axis}"][1] for axis in "xyz")
    _same_again(block, tmp_path / "copy")


def test_covariances_of_control_follow_the_axes_and_the_units(tmp_path: Path) -> None:
    block = read_block(_folder(tmp_path / "b", TABLES))
    assert block.points.id[block.ground_points.point].tolist() == ["A", "B", "C"]
    # A: sX (north) 1, sY (east) 1, sZ 3 cm by covariances.csv; sXY 0.25 cm^2
    expected = np.array([[1, 0.25, 0], [0.25, 1, 0], [0, 0, 9]]) * 1e-4
    np.testing.assert_allclose(block.ground_points.covariance_m2[0], expected, rtol=1e-14)
    rows = block.ground_point_covariances
    found = list(zip(rows.row_a.tolist(), rows.axis_a.tolist(), rows.row_b.tolist(), rows.axis_b.tolist()))
    assert found == [(0, 0, 1, 1), (0, 1, 1, 1)]
    np.testing.assert_allclose(rows.value, [0.5e-4, 1e-4], rtol=1e-14)
    _same_again(block, tmp_path / "copy")


def test_covariances_along_the_axes_of_another_frame_are_converted_as_its_points_are(tmp_path: Path) -> None:
    """North and east turned by the convergence of the meridians and scaled, by pyproj's own factors."""
    places = {"A": (40.0, 118.2), "B": (40.05, 119.0)}
    points = "".join(f"{p},{lat},{lon},0,3,2,2,geo\n" for p, (lat, lon) in places.items())
    stated = ["A,X,B,X,2.5", "A,X,B,Y,0.5", "B,Z,A,Z,1"]
    tables = TABLES | {
        "ground_points.csv": f"point,X,Y,Z,sX,sY,sZ,frame\nC,4430000,600000,3,2,2,2,\n{points}",
        "covariances.csv": "table,row_a,coord_a,row_b,coord_b,value\n"
        + "".join(f"ground_points,{c}\n" for c in stated),
    }
    block = read_block(_folder(tmp_path / "b", tables))
    turns = []
    for lat, lon in places.values():
        f = pyproj.Proj("EPSG:32650").get_factors(lon, lat)
        a, k = math.radians(f.meridian_convergence), f.meridional_scale
        turns.append(
            np.array([[k * math.cos(a), -k * math.sin(a), 0], [k * math.sin(a), k * math.cos(a), 0], [0, 0, 1]])
        )
    C = 1e-4 * np.array([[0, 0, 0], [0.5, 2.5, 0], [0, 0, 1.0]])  # east, north, up of A by those of B
    rows, found = block.ground_point_covariances, np.zeros((3, 3))
    found[rows.axis_a, rows.axis_b] = rows.value
    assert set(block.points.id[block.ground_points.point[rows.row_a]].tolist()) == {"A"}
    np.testing.assert_allclose(found, turns[0] @ C @ turns[1].T, atol=1e-10)
    _same_again(block, tmp_path / "copy")


def test_a_network_has_neither_images_nor_cameras(tmp_path: Path) -> None:
    block = read_block(_folder(tmp_path / "b", NETWORK))
    assert len(block.images) == len(block.cameras) == len(block.rejects) == 0
    assert (block.geodetic.start_height_m[0], block.geodetic.end_height_m[0]) == (1.5, 1.6)
    assert block.geodetic.reduced.tolist() == ["horizon"]
    _same_again(block, tmp_path / "copy")


def test_conditions_alone_make_a_block_without_images(tmp_path: Path) -> None:
    relative = "- {type: distance, points: [A, B], value: 2, exact: true}\n"
    block = read_block(_folder(tmp_path / "b", NETWORK, geodetic__csv=None, relative_control__yaml=relative))
    assert len(block.relative_control) == 1
    _same_again(block, tmp_path / "copy")


def _replaced(name: str, old: str, new: str) -> dict[str, str]:
    assert old in TABLES[name]
    return {name: TABLES[name].replace(old, new, 1)}


COVARIANCES = TABLES["covariances.csv"]
BAD = {
    "unknown rig": (_replaced("images.csv", "2.5,R", "2.5,Q"), "images.csv:4:13", "rig 'Q' is unknown"),
    "unknown member": (_replaced("images.csv", "left", "lefd"), "images.csv:3:15", "did you mean 'left'"),
    "rig to be added": (_replaced("images.csv", "1.5,R", "1.5,Q"), "images.csv:2:", "add it to `rigs` in block.yaml"),
    "rig without member": (_replaced("images.csv", "R,left", "R,"), "images.csv:3:", "both rig and member"),
    "member twice": (
        _replaced("images.csv", "2.5,R", "1.5,R"),
        "images.csv:4:",
        "twice in one exposure, first in line 2",
    ),
    "no time": (_replaced("images.csv", "2.5,R", ",R"), "images.csv:4:", "needs time, or strip and sequence"),
    "frame placed": (
        _replaced("block.yaml", "nadir: {}", "nadir: {position: [1, 0, 0]}"),
        "block.yaml:23:6",
        "is the frame",
    ),
    "empty rig": (_replaced("block.yaml", "rigs:\n", "rigs:\n  S: {}\n"), "block.yaml:23:6", "a rig needs members"),
    "rig key": (_replaced("block.yaml", "{angles: [30", "{angels: [30"), "block.yaml:24:", "did you mean 'angles'"),
    "rig sigma": (
        _replaced("block.yaml", "{position: 0.01,", "{postion: 0.01,"),
        "block.yaml:23:",
        "did you mean 'position'",
    ),
    "rig without unit": (
        _replaced("block.yaml", "angle: deg, sigma_i", "sigma_i"),
        "block.yaml:",
        "but a rig has angles",
    ),
    "mount": (_replaced("block.yaml", "mount: 90", "mount: 45"), "block.yaml:18:12", "mount is 45"),
    "undulation": (_replaced("block.yaml", "-12.3", "-1230"), "block.yaml:6:13", "undulation is -1230"),
    "heading": (_replaced("block.yaml", "roll-pitch-heading", "omega-phi-kappa"), "block.yaml:", "heading belongs to"),
    "unknown point": (_replaced("covariances.csv", "B,X,A,Y", "B,X,Q,Y"), "covariances.csv:2:19", "'Q' is unknown"),
    "coordinate": (_replaced("covariances.csv", "B,X,A,Y", "B,x,A,Y"), "covariances.csv:2:17", "coord_a is 'x'"),
    "twice": ({"covariances.csv": COVARIANCES + "ground_points,A,Y,B,X,0.5\n"}, "covariances.csv:6:", "given twice"),
    "own twice": (_replaced("covariances.csv", "A,Z,A,Z", "A,X,A,X"), "covariances.csv:3:", "the point has sX already"),
    "no coordinate": (
        _replaced("covariances.csv", "B,X,A,Y", "C,Z,A,Y"),
        "covariances.csv:2:",
        "without this coordinate",
    ),
    "exact": (_replaced("ground_points.csv", "3,2,2,2", "3,0,0,0"), "covariances.csv:2:", "is exact"),
    "too large": (
        _replaced("covariances.csv", "B,X,1", "B,X,2.5"),
        "ground_points.csv:3",
        "X of A, Y of A, Y of B is not positive definite",
    ),
    "with their own": (
        _replaced("covariances.csv", "Y,0.25", "Y,0.99"),
        "ground_points.csv:3",
        "X of A, Y of A, Y of B is not positive definite",
    ),
    "unknown table": (
        _replaced("covariances.csv", "ground_points,A,Z", "grond_points,A,Z"),
        "covariances.csv:3:1",
        "did you mean 'ground_points'",
    ),
    "geodetic": (
        {"covariances.csv": "table,row_a,row_b,value\ngeodetic,1,2,1\n"},
        "covariances.csv:2:1",
        "no geodetic.csv",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_a_fault_in_the_new_cells_is_told_with_its_place(tmp_path: Path, case: str) -> None:
    changes, place, what = BAD[case]
    folder = _folder(tmp_path / "b", TABLES | changes)
    with pytest.raises(AatriError) as caught:
        read_block(folder)
    message = str(caught.value)
    assert caught.value.exit_code == 3
    assert str(folder / place) in message
    assert what in message


@pytest.mark.parametrize("name", ["image_points.csv", "exterior.csv", "fiducials.csv"])
def test_a_table_of_images_needs_images(tmp_path: Path, name: str) -> None:
    folder = _folder(tmp_path / "b", NETWORK | {name: "image\n"})
    with pytest.raises(AatriError, match=r"images.csv"):
        read_block(folder)
