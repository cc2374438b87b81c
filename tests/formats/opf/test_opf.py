"""OPF: a point projected by the specification's formulas, places of several systems, marks, tracks, the examples."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
import pytest

from aatri.codes import APPROXIMATE_VALUE, CHECK, CONTROL, OBSERVED_VALUE
from aatri.errors import AatriError
from aatri.formats.opf.reader import read_opf
from aatri.formats.parts.assembled import assembled
from aatri.formats.parts.block_parts import BlockParts
from aatri.geometry.rotations import rotation_from_angles
from tests.formats.lens_projection import misfit_px
from tests.formats.opf.made_project import ANGLES_DEG, BUFFERS, CENTRE, FOCAL, RADIAL, TANGENTIAL, files


def written(folder: Path, **changes: tuple[str, str]) -> Path:
    """The project, some of its documents changed: `calibrated_cameras=(old, new)`."""
    (folder / "tracks").mkdir(parents=True)
    for name, data in BUFFERS.items():
        (folder / "tracks" / name).write_bytes(data)
    for name, text in files().items():
        old, new = changes.get(Path(name).stem.replace("-", "_"), ("", ""))
        assert old in text
        (folder / name).write_text(text.replace(old, new, 1) if old else text)
    return folder


def test_a_point_is_projected_by_the_formulas_of_the_specification(tmp_path: Path) -> None:
    """R = Rx Ry Rz takes x right, y up, z back to the canonical system; x = X/-Z, y = -Y/-Z, then R1 R2 R3 T1 T2."""
    block = assembled([read_opf(written(tmp_path / "p"))])
    w, p, k = map(math.radians, ANGLES_DEG)
    Rx = np.array([[1, 0, 0], [0, math.cos(w), -math.sin(w)], [0, math.sin(w), math.cos(w)]])
    Ry = np.array([[math.cos(p), 0, math.sin(p)], [0, 1, 0], [-math.sin(p), 0, math.cos(p)]])
    Rz = np.array([[math.cos(k), -math.sin(k), 0], [math.sin(k), math.cos(k), 0], [0, 0, 1]])
    X = np.array([500012.5, 4000021.0, 110.0]) - [500000.0, 4000000.0, 100.0]
    u = (Rx @ Ry @ Rz).T @ (X - [10.5, 20.25, 30.0])
    x, y = u[0] / -u[2], -u[1] / -u[2]
    r2 = x * x + y * y
    gain = 1 + RADIAL[0] * r2 + RADIAL[1] * r2**2 + RADIAL[2] * r2**3
    t1, t2 = TANGENTIAL
    at = [
        CENTRE[0] + FOCAL * (x * gain + 2 * t1 * x * y + t2 * (r2 + 2 * x * x)),
        CENTRE[1] + FOCAL * (y * gain + t1 * (r2 + 2 * y * y) + 2 * t2 * x * y),
    ]
    assert misfit_px(block, "flight 1/a.jpg", [at], [[500012.5, 4000021.0, 110.0]])[0] < 1e-6
    assert block.frames.crs.tolist() == ["EPSG:32650"]


def test_positions_control_marks_and_tracks(tmp_path: Path) -> None:
    parts = read_opf(written(tmp_path / "p"))
    exterior = dict(zip(parts.exterior["image"], parts.exterior["position_m"].tolist()))
    assert exterior["flight 1/b.jpg"] == [500011.0, 4000020.0, 130.0]
    assert exterior["flight 1/a.jpg"] == [500010.5, 4000020.25, 130.0]
    assert parts.exterior["position_use"] == [APPROXIMATE_VALUE, OBSERVED_VALUE]
    ground = parts.ground_points
    assert ground["point"] == ["G", "C"]
    assert ground["role"][:, 0].tolist() == [CONTROL, CHECK]
    east, north = pyproj.Transformer.from_crs("EPSG:4326", "EPSG:32650").transform(36.0, 117.0)
    np.testing.assert_allclose(ground["xyz_m"][1], [east, north, 110.0], rtol=0, atol=1e-6)
    # longitude 117 is the central meridian: no convergence; latitude comes first, so its sigma is that of north
    np.testing.assert_allclose(np.sqrt(np.diag(ground["covariance_m2"][1])), [0.02, 0.01, 0.03], rtol=2e-3)
    seen = {(i, p): xy for i, p, xy in zip(*(parts.image_points[k] for k in ("image", "point", "xy")))}
    assert seen["flight 1/b.jpg", "M"] == [100.5, 200.25]
    assert seen["flight 1/a.jpg", "track 0.0.0"] == [1.5, 2.5]
    assert seen["flight 1/b.jpg", "track 0.0.0"] == [3.5, 4.5]
    assert seen["flight 1/b.jpg", "track 0.0.1"] == [5.5, 6.5]
    assert parts.image_points["sigma_px"][0] == [0.5, 0.5]
    assert parts.notes == ["not read: gps-bias"]


def test_what_the_project_has_projected_is_taken_before_its_systems(tmp_path: Path) -> None:
    """Control above a geoid whose grid nobody has; the canonical place is in the project."""
    folder = written(tmp_path / "p", input_control_points=('"EPSG:4979"', '"EPSG:4326+5773"'))
    project = json.loads((folder / "project.opf").read_text())
    resource = {"uri": "projected.json", "format": "application/opf-projected-control-points+json"}
    project["items"].append({"type": "projected_control_points", "id": "9", "resources": [resource], "sources": []})
    (folder / "project.opf").write_text(json.dumps(project))
    rows = [{"id": "C", "coordinates": [1.5, 2.5, 3.5], "sigmas": [0.1, 0.1, 0.2]}]
    stated = {"format": "application/opf-projected-control-points+json", "version": "1.0", "projected_gcps": rows}
    (folder / "projected.json").write_text(json.dumps(stated))
    assert read_opf(folder).ground_points["xyz_m"][1].tolist() == [500001.5, 4000002.5, 103.5]
    (folder / "projected.json").write_text(json.dumps(stated | {"projected_gcps": []}))
    with pytest.raises(AatriError, match=r"us_nga_egm96_15.tif|egm96"):
        read_opf(folder)


def changed(folder: Path, change: Callable[[dict[str, Any]], None]) -> BlockParts:
    """What the project gives with other input cameras."""
    path = written(folder) / "input-cameras.json"
    stated = json.loads(path.read_text())
    change(stated)
    path.write_text(json.dumps(stated))
    return read_opf(folder)


@pytest.mark.parametrize("system", ["EPSG:32650", "EPSG:4979"])
def test_a_project_without_a_scene_is_in_the_map_of_its_geolocations(tmp_path: Path, system: str) -> None:
    """Not yet calibrated, or with calibrated places whose system nothing says; it was refused as without a frame."""
    folder = written(tmp_path / "p")
    project = json.loads((folder / "project.opf").read_text())
    project["items"] = [item for item in project["items"] if item["type"] != "scene_reference_frame"]
    (folder / "project.opf").write_text(json.dumps(project))
    place = [500011.0, 4000020.0, 130.0]
    if system == "EPSG:4979":
        path, to_degrees = folder / "input-cameras.json", pyproj.Transformer.from_crs("EPSG:32650", "EPSG:4979")
        stated = json.loads(path.read_text())
        own = {"definition": system}
        stated["captures"][1]["geolocation"] |= {"crs": own, "coordinates": list(to_degrees.transform(*place))}
        path.write_text(json.dumps(stated))
    parts = read_opf(folder)
    assert any("the calibrated places are in a system of their own, not read" in note for note in parts.notes)
    assert parts.exterior["image"] == ["flight 1/b.jpg"]
    block = assembled([parts])
    assert pyproj.CRS(str(block.frames.crs[0])).equals(pyproj.CRS("EPSG:32650"))
    np.testing.assert_allclose(block.exterior.position_m, [place], rtol=0, atol=1e-6)
    np.testing.assert_allclose(parts.ground_points["xyz_m"][0], [500012.5, 4000021.0, 110.0], rtol=0, atol=1e-6)


def test_yaw_pitch_roll_of_captures_is_told(tmp_path: Path) -> None:
    def turn(stated: dict[str, Any]) -> None:
        angles = {"angles_deg": [0.0, 0.0, 0.0], "sigmas_deg": [5.0, 5.0, 5.0]}
        stated["captures"][0]["orientation"] = {"type": "yaw_pitch_roll", **angles}

    assert changed(tmp_path / "p", turn).notes[1:] == ["yaw, pitch, roll of 1 capture are not read: 0"]


@pytest.mark.parametrize("crs", ["EPSG:32650", "EPSG:32651"])
def test_omega_phi_kappa_of_captures_is_observed_in_the_map_of_the_project(tmp_path: Path, crs: str) -> None:
    """In the neighbouring zone grid north is turned by the difference of the meridian convergences, to 2e-4."""

    def turn(stated: dict[str, Any]) -> None:
        angles = {"angles_deg": [1.0, -2.0, 30.0], "sigmas_deg": [0.1, 0.2, 0.3]}
        stated["captures"][1]["orientation"] = {"type": "omega_phi_kappa", "crs": crs, **angles}

    exterior = changed(tmp_path / "p", turn).exterior
    k = exterior["image"].index("flight 1/b.jpg")
    longitude, latitude = pyproj.Transformer.from_crs(32650, 4326, always_xy=True).transform(500011.0, 4000020.0)
    own, project = (
        pyproj.Proj(name).get_factors(longitude, latitude).meridian_convergence for name in (crs, "EPSG:32650")
    )
    to_project = math.radians(project - own)  # grid east of the zone, seen from that of the project
    c, s = math.cos(to_project), math.sin(to_project)
    expected = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ rotation_from_angles(np.radians([[1.0, -2.0, 30.0]]))[0]
    np.testing.assert_allclose(exterior["ground_from_image"][k], expected, rtol=0, atol=2e-4)
    assert exterior["angle_use"] == [APPROXIMATE_VALUE, OBSERVED_VALUE]
    np.testing.assert_allclose(np.degrees(exterior["angle_sigma_rad"][k]), [0.1, 0.2, 0.3])


def test_a_secondary_camera_is_mounted_as_the_specification_says(tmp_path: Path) -> None:
    """T_s = T_r + R_r T_rel, R_s = R_r R_rel in right, down, front: a point of the secondary camera seen from both."""
    relative = {
        "translation": {"values_m": [0.5, 0.25, -0.1], "sigmas_m": [0.01, 0.02, 0.03]},
        "rotation": {"angles_deg": [1.0, 40.0, -3.0], "sigmas_deg": [0.1, 0.2, 0.3]},
    }

    def mount(stated: dict[str, Any]) -> None:
        second = {**stated["sensors"][0], "id": 2, "rig_relatives": relative}
        stated["sensors"].append(second)
        one, other = stated["captures"]
        one["cameras"].append({**other["cameras"][0], "sensor_id": 2})
        one["geolocation"] = other["geolocation"]
        stated["captures"] = [one]

    parts = changed(tmp_path / "p", mount)
    assert parts.images["rig"] == ["cam 1", "cam 1"]
    assert parts.images["member"] == ["cam 1", "cam 2"]
    m = parts.others["rig_members"]
    assert m.is_frame.tolist() == [True, False]
    a, b, c = np.radians([1.0, 40.0, -3.0])
    Rx = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    Ry = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    Rz = np.array([[np.cos(c), -np.sin(c), 0], [np.sin(c), np.cos(c), 0], [0, 0, 1]])
    q = np.array([0.3, -0.2, 4.0])
    in_reference = (Rx @ Ry @ Rz @ q + [0.5, 0.25, -0.1]) * [1, -1, -1]
    mounted = rotation_from_angles(m.angles_rad[1]) @ (q * [1, -1, -1]) + m.position_m[1]
    np.testing.assert_allclose(mounted, in_reference, atol=1e-12)
    np.testing.assert_allclose(m.position_sigma_m[1], [0.01, 0.02, 0.03])
    np.testing.assert_allclose(np.degrees(m.angle_sigma_rad[1]), [0.1, 0.2, 0.3])


def test_a_geoid_height_raises_to_the_ellipsoid(tmp_path: Path) -> None:
    above = ('"EPSG:32650"', '"EPSG:32650+5773", "geoid_height": 7.5')
    folder = written(tmp_path / "p", input_control_points=above)
    assert read_opf(folder).ground_points["xyz_m"][0].tolist() == pytest.approx([500012.5, 4000021.0, 117.5])


DAMAGE = [
    ({"project": ('"camera-list.json"', '"../camera-list.json"')}, r"project.opf:\d+: .*leads out of the folder"),
    ({"project": ('"camera-list.json"', '"https://a.b/c.json"')}, r"project.opf:\d+: .*leads out of the folder"),
    ({"project": ('"camera-list.json"', '"camera.json"')}, r"project.opf:\d+: 'camera.json' does not exist"),
    ({"project": ('"version": "1.0"', '"version": "2.0"')}, r"project.opf:3: version '2.0'"),
    ({"sparse": ('"ranges.bin"', '"../../x.bin"')}, r"sparse.gltf:\d+: '../../x.bin' leads out of the folder"),
    ({"sparse": ('"primitives": [', '"primitives": [7, ')}, r"sparse.gltf:\d+: '0' is not an object"),
    ({"sparse": ('"cameraUids": [', '"cameraUids": [[], ')}, r"sparse.gltf:\d+: '0' is not"),
    ({"sparse": ('"extensions": {', '"extensions": 7, "x": {')}, r"sparse.gltf:\d+: 'extensions' is not an object"),
    ({"sparse": ('"count": 3', '"count": 9')}, r"sparse.gltf:\d+: 9 values reach beyond the end of cameras.bin"),
    ({"input_control_points": ('"camera_id": 7', '"camera_id": 8')}, r"points.json:\d+: camera 8 is not in the list"),
    ({"calibrated_cameras": ('"perspective"', '"fisheye"')}, r"cameras.json:\d+: sensor 1 is of the type 'fisheye'"),
    ({"input_cameras": ('"sensor_id": 1', '"sensor_id": 3')}, r"input-cameras.json:\d+: sensor 3 is not there"),
    ({"camera_list": ("b.jpg", "a.jpg")}, r"camera-list.json:\d+: flight 1/a.jpg is of two cameras"),
    ({"input_control_points": ('"mtps"', '"ties"')}, r"input-control-points.json:\d+: 'mtps' is missing"),
    ({"input_control_points": ('"gcps": [', '"gcps": 7, "x": [')}, r"input-control-points.json:\d+: 'gcps' is not"),
    ({"input_cameras": ('"captures": [', '"captures": [], "x": [')}, r"input-cameras.json:\d+: no captures"),
    ({"scene_reference_frame": ("32650", "4326")}, r"frame.json:\d+: the base is no map"),
    ({"scene_reference_frame": ("1.0,\n   1.0", "0.3048,\n   1.0")}, r"frame.json:\d+: the scale from the base"),
]


@pytest.mark.parametrize(("changes", "message"), DAMAGE)
def test_damaged_projects_are_refused_with_their_place(
    tmp_path: Path, changes: dict[str, tuple[str, str]], message: str
) -> None:
    with pytest.raises(AatriError, match=message) as refused:
        read_opf(written(tmp_path / "p", **changes))
    assert "fix: " in str(refused.value)


def test_the_examples_of_the_specification_end_in_a_message_that_names_what_is_missing(interchange: Path) -> None:
    """They are no consistent block: the tracks that the project names are not among them."""
    folder = interchange / "opf" / "examples"
    with pytest.raises(AatriError, match=r"project.opf:\d+: 'point_cloud/sparse.gltf' does not exist"):
        read_opf(folder)
