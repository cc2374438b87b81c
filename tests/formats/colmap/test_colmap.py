"""COLMAP models: conventions, round trips text and binary, and agreement with pycolmap where it is installed."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aatri.artifacts.block import CHECK, CONTROL, OBSERVED_VALUE, Block
from aatri.camera.models import forward_models
from aatri.camera.pixels import mm_from_pixel
from aatri.errors import AatriError
from aatri.formats.colmap.writer import write_colmap_model
from aatri.formats.results.oriented_block import OrientedBlock
from aatri.geometry.collinearity import in_image_axes, project
from aatri.geometry.rotations import rotation_from_angles
from aatri.tables.digest import content_digest
from tests.formats.start_solution import start_solution, write_binary
from tests.made_solutions import made_block, made_solution
from tests.reading import read_bal, read_colmap, read_dbat

# A camera at (0, 0, 10) looking down, its x axis along X: in COLMAP's axes q = (0, 1, 0, 0), t = (0, 0, 10).
CAMERAS = "# comment\n1 OPENCV 100 80 50 50 52 39 0.1 -0.02 0.003 -0.004\n2 PINHOLE 100 80 50 40 50 40\n"
IMAGES = (
    "# comment\n"
    "7 0 1 0 0 0 0 10 1 b.jpg\n60.5 30.25 3 12 12 -1 20 20 4 30 30 5\n"
    "8 0 1 0 0 -1 0 10 2 a b.jpg\n55 41 3 60 20 4 20 60 5\n"
    "9 0 1 0 0 -2 0 10 2 empty.jpg\n\n"
)
POINTS = "3 1 2 0 9 9 9 0.5 7 0 8 0\n4 3 4 1 0 0 0 0.5 7 2 8 1\n5 -3 -4 1 0 0 0 0.5 7 3 8 2\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A made model of two images and three points, and an image without features."""
    for name, text in (("cameras", CAMERAS), ("images", IMAGES.split("9 0 1")[0]), ("points3D", POINTS)):
        (tmp_path / f"{name}.txt").write_text(text)
    return tmp_path


def _reprojection_px(block: Block) -> np.ndarray:
    """Lengths of the reprojection errors at the start values, by image and point."""
    image, point = block.image_points.image, block.image_points.point
    R = rotation_from_angles(block.exterior.angles_rad)
    xyz = np.full((len(block.points), 3), np.nan)
    xyz[block.ground_points.point] = block.ground_points.xyz_m
    uv = project(in_image_axes(block.exterior.position_m[image], R[image], xyz[point]), np.ones(len(image)))
    camera, cameras, table = block.images.camera[image], block.cameras, block.camera_parameters
    errors = np.zeros(len(image))
    for k in range(len(cameras)):
        rows, own = camera == k, table.camera == k
        ideal = uv[rows] * [1, -1]
        if cameras.distortion[k] != "none":
            names = forward_models.PARAMETERS[str(cameras.distortion[k])]
            values = {n: v for n, v in zip(table.name[own], table.value[own]) if n in names}
            ideal, _ = getattr(forward_models, str(cameras.distortion[k]))(ideal, values)
        computed = ideal * [1, -1] * cameras.principal_distance_mm[k] + cameras.principal_point_mm[k]
        A = mm_from_pixel(cameras.pixel_size_mm[k], cameras.pixel_origin[k], cameras.pixel_y[k], cameras.format[k])
        measured = block.image_points.xy[rows] @ A[:, :2].T + A[:, 2]
        errors[rows] = np.linalg.norm((computed - measured) / cameras.pixel_size_mm[k], axis=1)
    return errors


def test_axes_origin_and_pose_are_turned_into_ours(folder: Path) -> None:
    block = read_colmap(folder)
    assert block.images.id.tolist() == ["a b.jpg", "b.jpg"]
    np.testing.assert_allclose(block.exterior.position_m, [[1, 0, 10], [0, 0, 10]], atol=1e-15)
    np.testing.assert_allclose(rotation_from_angles(block.exterior.angles_rad), [np.eye(3)] * 2, atol=1e-15)
    # principal point (52, 39) of 100 x 80: 2 px right, 1 px up; a pixel is 1 um
    assert block.cameras.principal_point_mm[0].tolist() == pytest.approx([0.002, 0.001])
    assert block.cameras.principal_distance_mm.tolist() == pytest.approx([0.05, 0.05])
    assert block.cameras.pixel_size_mm[1].tolist() == pytest.approx([0.001, 0.001 * 50 / 40])
    assert block.cameras.distortion.tolist() == ["opencv", "none"]
    assert block.image_points.xy[3].tolist() == [60.5, 30.25]
    # the feature without a point is no image point
    assert len(block.image_points) == 6


def test_reprojection_is_that_of_the_formulas(folder: Path) -> None:
    errors = _reprojection_px(read_colmap(folder))
    # image 8: P = (X - 1, -Y, 10 - Z), fx 50, fy 40, centre 50 40
    expected = [
        np.hypot(50 + 50 * (1 - 1) / 10 - 55, 40 - 40 * 2 / 10 - 41),
        np.hypot(50 + 50 * (3 - 1) / 9 - 60, 40 - 40 * 4 / 9 - 20),
        np.hypot(50 + 50 * (-3 - 1) / 9 - 20, 40 + 40 * 4 / 9 - 60),
    ]
    np.testing.assert_allclose(errors[:3], expected, rtol=1e-13)
    # image 7, point 3: u 0.1, v -0.2; OpenCV's formula by hand
    u, v, r2 = 0.1, -0.2, 0.05
    radial = 1 + 0.1 * r2 - 0.02 * r2**2
    x = 52 + 50 * (u * radial + 2 * 0.003 * u * v - 0.004 * (r2 + 2 * u * u))
    y = 39 + 50 * (v * radial + 0.003 * (r2 + 2 * v * v) + 2 * -0.004 * u * v)
    assert errors[3] == pytest.approx(np.hypot(x - 60.5, y - 30.25), rel=1e-13)


def test_positions_are_observed_where_a_standard_deviation_is_given(folder: Path) -> None:
    assert (read_colmap(folder).exterior.position_use != OBSERVED_VALUE).all()
    exterior = read_colmap(folder, position_sigma_m=0.05).exterior
    assert (exterior.position_use == OBSERVED_VALUE).all()
    np.testing.assert_allclose(exterior.position_covariance_m2[0], np.eye(3) * 0.0025)
    assert (exterior.angle_use != OBSERVED_VALUE).all()


def test_control_comes_from_a_table_of_the_block_folder(folder: Path, tmp_path: Path) -> None:
    control = tmp_path / "gcp.csv"
    control.write_text("point,X,Y,Z,sX,sY,sZ,role\n3,1.1,2.1,0.1,0.02,0.02,0.03,control\n5,-3,-4,1,,,,check\n")
    block = read_colmap(folder, control=control)
    assert block.ground_points.role.tolist() == [[CONTROL] * 3, [3] * 3, [CHECK] * 3]
    assert block.ground_points.xyz_m[0].tolist() == [1.1, 2.1, 0.1]
    assert np.sqrt(np.diag(block.ground_points.covariance_m2[0])).tolist() == pytest.approx([0.02, 0.02, 0.03])
    assert str(block.files.path[block.ground_points.file[0]]) == str(control)


def test_free_are_the_parameters_that_the_model_of_colmap_has(folder: Path) -> None:
    table = read_colmap(folder, calibrate=True).camera_parameters
    interior = {"principal_distance", "principal_point.x", "principal_point.y"}
    assert set(table.name[(table.camera == 0) & table.free].tolist()) == {"k1", "k2", "p1", "p2"} | interior
    assert set(table.name[(table.camera == 1) & table.free].tolist()) == interior
    assert not read_colmap(folder).camera_parameters.free.any()


@pytest.mark.parametrize("binary", [False, True])
def test_a_model_written_and_read_again_is_the_same_block(folder: Path, tmp_path: Path, binary: bool) -> None:
    first = read_colmap(folder)
    out = tmp_path / "out"
    (write_binary if binary else write_colmap_model)(OrientedBlock(first, start_solution(first)), out)
    assert len(list(out.iterdir())) == 3
    again = read_colmap(out)
    assert again.images.id.tolist() == first.images.id.tolist()
    assert again.points.id.tolist() == first.points.id.tolist()
    np.testing.assert_allclose(again.image_points.xy, first.image_points.xy, rtol=1e-14)
    np.testing.assert_allclose(again.exterior.position_m, first.exterior.position_m, atol=1e-14)
    np.testing.assert_allclose(_reprojection_px(again), _reprojection_px(first), rtol=1e-12)


@pytest.mark.slow
def test_text_and_binary_hold_the_same(shared_data: Path, tmp_path: Path) -> None:
    block = read_bal(shared_data / "bal/problem-49-7776-pre.txt")
    solution = start_solution(block)
    blocks = []
    for binary in (False, True):
        (write_binary if binary else write_colmap_model)(
            OrientedBlock(block, solution), tmp_path / str(binary) / "model"
        )
        blocks.append(read_colmap(tmp_path / str(binary) / "model"))
    assert content_digest(blocks[0]) == content_digest(blocks[1])
    assert [Path(p).suffix for p in blocks[1].files.path.tolist()] == [".bin"] * 3


def _models(shared_data: Path) -> dict[str, Any]:
    """Blocks with cameras of every kind, with a solution."""
    ladybug = read_bal(shared_data / "bal/problem-49-7776-pre.txt")
    frames = read_dbat(shared_data / "dbat/camcal/camcal-pmexport.txt")
    frames = dataclasses.replace(frames, cameras=dataclasses.replace(frames.cameras, distortion=np.array(["none"])))
    film = made_block()
    film = dataclasses.replace(film, cameras=dataclasses.replace(film.cameras, format=np.array([[400.0, 400.0]])))
    return {
        "bal": (ladybug, start_solution(ladybug)),
        "digital": (frames, start_solution(frames)),
        "film": (film, made_solution(film)),
    }


@pytest.mark.slow
@pytest.mark.parametrize("binary", [False, True])
@pytest.mark.parametrize("name", ["bal", "digital", "film"])
def test_pycolmap_reads_what_is_written_with_equal_reprojection_errors(
    shared_data: Path, tmp_path: Path, name: str, binary: bool
) -> None:
    pycolmap = pytest.importorskip("pycolmap")
    block, solution = _models(shared_data)[name]
    (write_binary if binary else write_colmap_model)(OrientedBlock(block, solution), tmp_path)
    model = pycolmap.Reconstruction(str(tmp_path))
    again = read_colmap(tmp_path)
    errors = _reprojection_px(again)
    assert model.num_reg_images() == len(again.images)
    assert model.compute_num_observations() == len(block.image_points)
    by_name = {image.name: image for image in model.images.values()}
    rows = again.image_points
    for row in range(0, len(rows), max(1, len(rows) // 500)):
        image = by_name[str(again.images.id[rows.image[row]])]
        xyz = again.ground_points.xyz_m[rows.point[row]]
        computed = image.project_point(xyz)
        if computed is None:  # behind the camera
            continue
        assert np.linalg.norm(computed - rows.xy[row]) == pytest.approx(errors[row], rel=1e-6, abs=1e-6)
    mean = np.mean([point.error for point in model.points3D.values()])
    model.update_point_3d_errors()
    if name != "bal":  # pycolmap has no error of points behind a camera
        assert mean == pytest.approx(np.mean([point.error for point in model.points3D.values()]), rel=1e-6, abs=1e-6)


def _unit(q: list[float]) -> np.ndarray:
    return np.array(q) / np.linalg.norm(q)


@pytest.mark.parametrize(
    "model",
    [
        "SIMPLE_PINHOLE",
        "PINHOLE",
        "SIMPLE_RADIAL",
        "RADIAL",
        "OPENCV",
        "OPENCV_FISHEYE",
        "FULL_OPENCV",
        "SIMPLE_RADIAL_FISHEYE",
        "RADIAL_FISHEYE",
        "SIMPLE_FISHEYE",
        "FISHEYE",
    ],
)
@pytest.mark.parametrize("binary", [False, True])
def test_every_camera_model_projects_as_pycolmap_does(tmp_path: Path, model: str, binary: bool) -> None:
    pycolmap = pytest.importorskip("pycolmap")
    camera = pycolmap.Camera.create_from_model_name(1, model, 500.0, 640, 480)
    values = np.array(camera.params)
    one = camera.params_info.split(",")[0].strip() == "f"
    first = 3 if one else 4
    values[first - 2 : first] = [318.0, 243.5]
    if not one:
        values[1] = 490.0
    values[first:] = [0.03, -0.02, 0.004, -0.003, 0.002, 0.01, -0.01, 0.002][: len(values) - first]
    camera.params = values
    model_out = pycolmap.Reconstruction()
    model_out.add_camera_with_trivial_rig(camera)
    X = np.array([[0.3, 0.2, 3.0], [-0.5, 0.4, 4.0], [0.1, -0.6, 3.5], [0.7, 0.5, 4.5]])
    for k in (1, 2):
        pose = pycolmap.Rigid3d(pycolmap.Rotation3d(_unit([0.05 * k, -0.02, 0.1, 0.99])), np.array([0.1 * k, 0, 0.2]))
        image = pycolmap.Image(name=f"{k}.jpg", camera_id=1, image_id=k)
        image.points2D = pycolmap.Point2DList([pycolmap.Point2D(camera.img_from_cam(pose * x)) for x in X])
        model_out.add_image_with_trivial_frame(image, pose)
    for row, x in enumerate(X):
        track = pycolmap.Track()
        for k in (1, 2):
            track.add_element(k, row)
        model_out.add_point3D(x, track)
    (model_out.write_binary if binary else model_out.write_text)(str(tmp_path))
    block = read_colmap(tmp_path)
    assert len(block.image_points) == 8
    assert _reprojection_px(block).max() < 1e-9


@pytest.mark.parametrize(
    ("name", "old", "new", "line", "what"),
    [
        ("cameras", "PINHOLE", "PINHOL", ":3", "did you mean 'PINHOLE'"),
        ("cameras", "PINHOLE 100 80 50 40", "FOV 100 80 50 40 1", ":3", "which has no like here"),
        ("cameras", "50 40 50 40", "50 40 50", ":3", "3 parameters of a PINHOLE"),
        ("cameras", "50 40 50 40", "50 -40 50 40", ":3", "no positive focal length"),
        ("images", "10 1 b.jpg", "10 3 b.jpg", ":2", "names camera 3, which is not there"),
        ("images", "2 a b.jpg", "2 b.jpg", ":4", "images 7 and 8 have one name"),
        ("images", "60.5 30.25 3", "60.5 30.25", ":3", "11 words"),
        ("images", "60.5 30.25 3", "60.5 30.25 33", ":2", "shows point 33, which is not in points3D"),
        ("images", "60.5 30.25 3", "60,5 30.25 3", ":3", "'60,5': a decimal comma"),
        ("images", "7 0 1", "7 x 1", ":2", "'x': not a number"),
        ("images", "8 0 1 0 0", "8 0 0 0 0", ":4", "no rotation"),
        ("images", "8 0 1 0 0", "8 0 1e-320 0 0", ":4", "too small for a quantity"),
        ("points3D", "4 3 4 1 0", "3 3 4 1 0", "", "a point stands twice"),
        ("points3D", "4 3 4 1 0 0 0 0.5 7 2 8 1", "4 3 4", ":2", "3 words"),
    ],
)
def test_a_malformed_line_is_named(folder: Path, name: str, old: str, new: str, line: str, what: str) -> None:
    path = folder / f"{name}.txt"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(AatriError) as caught:
        read_colmap(folder)
    assert caught.value.exit_code == 3
    assert f"{path}{line}: " in str(caught.value) or name == "points3D"
    assert what in str(caught.value)


def test_a_binary_file_that_ends_early_is_named(folder: Path, tmp_path: Path) -> None:
    block = read_colmap(folder)
    out = tmp_path / "binary"
    write_binary(OrientedBlock(block, start_solution(block)), out)
    (out / "images.bin").write_bytes((out / "images.bin").read_bytes()[:-5])
    with pytest.raises(AatriError, match=r"images.bin: ends at byte"):
        read_colmap(out)
