"""OpenSfM's files: known points project where OpenSfM has them; frames and lists beside them; damaged files."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.block import Block
from aatri.camera.models import forward_models
from aatri.camera.pixels import mm_from_pixel
from aatri.errors import AatriError
from aatri.formats.parts.assembled import assembled
from aatri.formats.parts.format import Reading
from aatri.formats.registry.sources import read_source
from aatri.frames.conversion import Frame
from aatri.geometry.collinearity import in_image_axes
from aatri.geometry.rotations import rotation_from_angles
from aatri.progress import SILENT
from tests.formats.opensfm.made_project import CAMERAS, write_project

UTM = Frame("utm", ("east", "north", "up"), "EPSG:32632")


def read(*paths: Path, frame: Frame | None = None) -> Block:
    return assembled([read_source(p, Reading(), SILENT) for p in paths], frame=frame)


def misfits_px(block: Block) -> np.ndarray:
    """Measured image points less the projection of the start values."""
    measured, camera, exterior = block.image_points, block.cameras, block.exterior
    row = np.argsort(exterior.image)[measured.image]
    xyz = np.full((len(block.points), 3), np.nan)
    xyz[block.ground_points.point] = block.ground_points.xyz_m
    R = rotation_from_angles(exterior.angles_rad[row])
    u = in_image_axes(exterior.position_m[row], R, xyz[measured.point])
    p = block.camera_parameters
    values = {str(n): float(v) for n, v in zip(p.name, p.value) if np.isfinite(v)}
    uv, _ = forward_models.MODELS[str(camera.distortion[0])](u[:, :2] * [-1.0, 1.0] / u[:, 2:], values)
    mm = uv * [1.0, -1.0] * camera.principal_distance_mm[0] + camera.principal_point_mm[0]
    to_mm = mm_from_pixel(camera.pixel_size_mm[0], camera.pixel_origin[0], camera.pixel_y[0], camera.format[0])
    return (measured.xy @ to_mm[:, :2].T + to_mm[:, 2] - mm) / camera.pixel_size_mm[0]


@pytest.mark.parametrize("kind", CAMERAS)
def test_points_project_where_opensfm_has_them(tmp_path: Path, kind: str) -> None:
    folder = write_project(tmp_path, kind)
    block = read(folder / "reconstruction.json", folder / "tracks.csv")
    assert len(block.image_points) > 60
    assert np.abs(misfits_px(block)).max() < 1e-8


def test_the_horizon_becomes_a_map_with_its_convergence(tmp_path: Path) -> None:
    """Rotations turn with the axes: the same rays, but for the map's scale and the curvature of the earth."""
    folder = write_project(tmp_path)
    block = read(folder / "reconstruction.json", folder / "tracks.csv", frame=UTM)
    assert block.frames.crs.tolist() == ["EPSG:32632"]
    assert np.abs(block.exterior.position_m[:, 0] - 424_000).max() < 2000  # a degree west of the central meridian
    # the map is 4e-4 shorter than the ground, 0.8 px at the edge; without its convergence of 0.73 degrees: 20 px
    assert np.abs(misfits_px(block)).max() < 1.0
    assert block.exterior.position_m[:, 2] == pytest.approx(490.0, abs=0.01)


def test_control_and_positions_of_lists_are_joined_by_names(tmp_path: Path) -> None:
    folder = write_project(tmp_path)
    rows = [f"{424000 + 20 * k} 5205700 {400 + k} {100 * k + 10} 50 img_0.JPG p{k}" for k in range(4)]
    (folder / "gcp_list.txt").write_text("EPSG:32632\n" + "\n".join(rows) + "\n")
    geo = ["EPSG:4326", *(f"flight/IMG_{k}.tif 8.0 47.0 490 10 0 0 0.02 0.03" for k in range(6)), "OTHER.JPG 8 47 490"]
    (folder / "geo.txt").write_text("\n".join(geo))
    block = read(*(folder / name for name in ("reconstruction.json", "tracks.csv", "gcp_list.txt", "geo.txt")))
    assert block.frames.crs.tolist() == ["EPSG:32632"]
    assert block.metrics()["control_points"] == 4
    assert block.exterior.position_use.tolist() == [1] * 6
    np.testing.assert_allclose(
        np.sqrt(np.einsum("nii->ni", block.exterior.position_covariance_m2)), [[0.02, 0.02, 0.03]] * 6, rtol=1e-3
    )
    first = block.image_points.xy[block.points.id[block.image_points.point] == "p0"]
    assert first.tolist() == [[10.5, 50.5]]  # the centre of the first pixel is half a pixel from the corner
    assert {Path(p).name for p in block.files.path} == {"reconstruction.json", "tracks.csv", "gcp_list.txt", "geo.txt"}


def test_positions_of_shots_that_are_not_read_are_told(tmp_path: Path) -> None:
    folder = write_project(tmp_path)
    document = json.loads((folder / "reconstruction.json").read_text())
    document[0]["shots"]["IMG_3.JPG"]["gps_position"] = [1.0, 2.0, 3.0]
    (folder / "reconstruction.json").write_text(json.dumps(document))
    notes = read_source(folder / "reconstruction.json", Reading(), SILENT).notes
    what = "gps_position of 1 shot is not read: IMG_3.JPG; give the photographs or geo.txt beside it"
    assert what in notes


def _json(change: str, value: object) -> object:
    def changed(folder: Path) -> Path:
        path = folder / "reconstruction.json"
        document = json.loads(path.read_text())
        at = document
        *keys, last = [int(k) if k.isdigit() else k for k in change.split("/")]
        for key in keys:
            at = at[key]
        if value is None:
            del at[last]
        else:
            at[last] = value
        path.write_text(json.dumps(document, indent=1))
        return path

    return changed


def _text(name: str, old: str, new: str) -> object:
    def changed(folder: Path) -> Path:
        path = folder / name
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new, 1))
        return path

    return changed


def _bytes(name: str, data: bytes) -> object:
    def changed(folder: Path) -> Path:
        (folder / name).write_bytes(data)
        return folder / name

    return changed


def _pixels(folder: Path) -> Path:
    path = folder / "tracks.csv"
    head, first, *rest = path.read_text().split("\n")
    words = first.split("\t")
    path.write_text("\n".join([head, "\t".join([*words[:3], "1999.5", "1200.5", *words[5:]]), *rest]))
    return path


DAMAGED = {
    "truncated": (_text("reconstruction.json", '"reference_lla"', ""), "no JSON"),
    "other encoding": (_bytes("reconstruction.json", '[{"cameras": {"Größe"'.encode("cp1252")), "not UTF-8"),
    "wrong version": (_text("tracks.csv", "_v2", "_v7"), "tracks of version 7"),
    "unknown camera model": (_json("0/cameras/c/projection_type", "dual"), "'dual', which has no like here"),
    "missing section": (_json("0/shots", None), "'shots' is missing"),
    "duplicated ids": (_text("reconstruction.json", "IMG_1.JPG", "IMG_0.JPG"), "stands twice in one object"),
    "NaN": (_text("reconstruction.json", '"capture_time": 100.0', '"capture_time": NaN'), "NaN is no number"),
    "wrong unit": (_pixels, "outside of an image"),
    "decimal commas": (_text("tracks.csv", "0.001\t", "0,001\t0\t"), "12 columns"),
    "HTML": (_bytes("tracks.csv", b"<!DOCTYPE html>\n<html></html>\n"), "web page"),
    "number of 200 digits": (_json("0/shots/IMG_3.JPG/capture_time", 10**200), "is too large"),
    "unknown camera": (_json("0/shots/IMG_3.JPG/camera", "d"), "'d', which is not there"),
    "no numbers": (_json("0/shots/IMG_3.JPG/rotation", [0, 0]), "not a list of 3 numbers"),
}


@pytest.mark.parametrize("how", DAMAGED)
def test_damaged_files_are_refused_with_their_place(tmp_path: Path, how: str) -> None:
    change, what = DAMAGED[how]
    path = change(write_project(tmp_path))  # type: ignore[operator]
    name = "opensfm_tracks" if path.suffix == ".csv" else "opensfm"
    with pytest.raises(AatriError, match=what) as caught:
        read_source(path, Reading(format=name), SILENT)
    assert caught.value.exit_code == 3
    assert f"{path}:" in str(caught.value)


def test_plan_control_alone_is_recognised(tmp_path: Path) -> None:
    (tmp_path / "g.txt").write_text("EPSG:32617\n1 2 NaN 4 5 a.jpg p\n")
    points = read_source(tmp_path / "g.txt", Reading(), SILENT).ground_points
    assert np.asarray(points["role"]).tolist() == [[1, 1, 0]]


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("PUWG1992\n1 2 3 4 5 a.jpg\n", "'PUWG1992' names no coordinate system"),
        ("EPSG:32617\n1 2 3 4 5\n", ":2: 5 words"),
        ("EPSG:32617\n1 2 3,5 4 5 a.jpg\n", ":2: '3,5': a decimal comma"),
        ("EPSG:32617\n1 2 3 40 0 500 a.jpg p\n", ":2: '500' stands where the name of an image should"),
        ("EPSG:32617\n1 2 3 4 5 photo 1.jpg p\n", ":2: 'photo 1.jpg' is no name of an image: blanks separate columns"),
        ("EPSG:99999\n1 2 3 4 5 a.jpg\n", "no known coordinate system"),
        ("EPSG:32617\n1 2 3 4 5 a.jpg p\n1 2 4 4 5 b.jpg p\n", ":3: point 'p' has other coordinates"),
    ],
)
def test_wrong_lists_of_control_are_refused(tmp_path: Path, text: str, what: str) -> None:
    (tmp_path / "g.txt").write_text(text)
    with pytest.raises(AatriError, match=what):
        read_source(tmp_path / "g.txt", Reading(format="odm_gcp"), SILENT)
