"""Bundle Adjustment in the Large: the Ladybug problem read, written and read again."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts import image_points as ip
from aatri.artifacts.block import APPROXIMATE, Block
from aatri.artifacts.block_tables import CameraParameters
from aatri.artifacts.residuals import Residuals
from aatri.artifacts.solution import Solution
from aatri.artifacts.suspects import Suspects
from aatri.camera.models.forward_models import bal
from aatri.errors import AatriError
from aatri.formats.bal.problem import NAME, PIXEL_MM, read_problem, write_bal_problem
from aatri.formats.results.oriented_block import OrientedBlock
from aatri.geometry.collinearity import in_image_axes, project
from aatri.geometry.rotations import rotation_from_angles
from tests.formats.start_solution import start_solution
from tests.made_solutions import made_block, made_solution
from tests.reading import read_bal


@pytest.fixture(scope="module")
def path(shared_data: Path) -> Path:
    return shared_data / "bal/problem-49-7776-pre.txt"


@pytest.fixture(scope="module")
def block(path: Path) -> Block:
    return read_bal(path)


def _residuals_px(block: Block) -> np.ndarray:
    """Computed minus measured, by the tables of the Block."""
    image, point = block.image_points.image, block.image_points.point
    assert block.exterior.image.tolist() == list(range(len(block.images)))
    assert block.ground_points.point.tolist() == list(range(len(block.points)))
    R = rotation_from_angles(block.exterior.angles_rad)
    u = in_image_axes(block.exterior.position_m[image], R[image], block.ground_points.xyz_m[point])
    c = block.cameras.principal_distance_mm[block.images.camera]
    named = block.camera_parameters
    k1, k2 = (named.value[named.name == name][block.images.camera] for name in ("k1", "k2"))
    uv = project(u, np.ones(len(u)))
    xy = np.empty_like(uv)
    for k in range(len(block.images)):
        rows = image == k
        xy[rows] = bal(uv[rows], {"k1": k1[k], "k2": k2[k]})[0] * c[k]
    return xy / PIXEL_MM - block.image_points.xy


def _cost_of_the_file(path: Path) -> float:
    """Half the sum of squares, by the formulas of the README alone (Rodrigues)."""
    problem = read_problem(path)
    cameras, X = problem.cameras[problem.camera], problem.points[problem.point]
    w = cameras[:, :3]
    angle = np.linalg.norm(w, axis=1)[:, None]
    axis = w / angle
    cos, sin = np.cos(angle), np.sin(angle)
    P = X * cos + np.cross(axis, X) * sin + axis * (axis * X).sum(1)[:, None] * (1 - cos) + cameras[:, 3:6]
    p = -P[:, :2] / P[:, 2:]
    r2 = (p**2).sum(1)
    predicted = (cameras[:, 6] * (1 + cameras[:, 7] * r2 + cameras[:, 8] * r2**2))[:, None] * p
    return 0.5 * float(((predicted - problem.xy_px) ** 2).sum())


@pytest.mark.slow
def test_the_cost_at_the_start_is_that_of_the_file(block: Block, path: Path) -> None:
    expected = _cost_of_the_file(path)
    assert expected == pytest.approx(8.509125e5, rel=1e-6)  # README of the data set
    assert 0.5 * float((_residuals_px(block) ** 2).sum()) == pytest.approx(expected, rel=1e-12)


def test_nothing_is_rejected_and_the_31_observations_behind_their_camera_are_kept(block: Block) -> None:
    assert (len(block.images), len(block.points), len(block.image_points)) == (49, 7776, 31843)
    assert len(block.rejects) == 0
    assert block.image_points.active.all()
    image, point = block.image_points.image, block.image_points.point
    R = rotation_from_angles(block.exterior.angles_rad)
    u = in_image_axes(block.exterior.position_m[image], R[image], block.ground_points.xyz_m[point])
    assert int((u[:, 2] >= 0).sum()) == 31


def test_each_image_has_a_camera_of_its_own_with_free_f_k1_k2(block: Block) -> None:
    assert block.images.id.tolist() == block.cameras.id.tolist()
    assert block.images.camera.tolist() == list(range(49))
    row = block.images.id.tolist().index("1")
    parameters = block.camera_parameters.take(block.camera_parameters.camera == row)
    # lines of camera 1 in the file, re-keyed
    assert block.cameras.principal_distance_mm[row] == pytest.approx(4.0201753385955931e02 * 1e-3, rel=1e-15)
    assert parameters.name[parameters.free].tolist() == ["k1", "k2", "principal_distance"]
    assert parameters.sigma[~parameters.free].tolist() == [0.0, 0.0]
    assert (block.ground_points.role == APPROXIMATE).all()
    assert (block.image_points.sigma_mm == 0.001).all()


def test_fixed_cameras_when_not_calibrating(path: Path) -> None:
    assert not read_bal(path, calibrate=False).camera_parameters.free.any()


@pytest.mark.slow
def test_writing_and_reading_again_gives_the_same_problem(block: Block, path: Path, tmp_path: Path) -> None:
    write_bal_problem(OrientedBlock(block, start_solution(block)), tmp_path)
    written = tmp_path / NAME
    first, again = read_problem(path), read_problem(written)
    for rows in (first, again):
        assert (np.diff(rows.point) >= 0).all()
    np.testing.assert_array_equal(np.stack([first.camera, first.point]), np.stack([again.camera, again.point]))
    np.testing.assert_allclose(again.xy_px, first.xy_px, rtol=1e-13)
    np.testing.assert_allclose(again.cameras, first.cameras, rtol=1e-11, atol=1e-14)
    np.testing.assert_array_equal(again.points, first.points)
    assert _cost_of_the_file(written) == pytest.approx(_cost_of_the_file(path), rel=1e-11)


@pytest.mark.slow
def test_an_observation_rejected_by_the_solution_is_not_written(block: Block, tmp_path: Path) -> None:
    solution = start_solution(block, rejected=[0, 7])
    write_bal_problem(OrientedBlock(block, solution), tmp_path)
    written = tmp_path / NAME
    assert len(read_problem(written).camera) == 31843 - 2


def test_a_film_block_is_written_from_its_corrected_image_points(tmp_path: Path) -> None:
    block = made_block()
    solution: Solution = made_solution(block)
    write_bal_problem(OrientedBlock(block, solution), tmp_path)  # photo coordinates, no distortion
    written = tmp_path / NAME
    assert _cost_of_the_file_near(written) < 1e-18
    k1 = CameraParameters(
        camera=np.array([0]),
        name=np.array(["k1"]),
        value=np.array([1e-8]),
        sigma=np.array([np.nan]),
        free=np.array([False]),
    )
    brown = dataclasses.replace(block.cameras, distortion=np.array(["brown"]))
    bent = dataclasses.replace(block, cameras=brown, camera_parameters=k1)
    corrected = _image_points(block)
    solution = dataclasses.replace(solution, residuals=Residuals.empty())  # those made up are not of these rays
    write_bal_problem(OrientedBlock(bent, solution, corrected), tmp_path)
    written = tmp_path / NAME
    assert _cost_of_the_file_near(written) < 1e-18


def _cost_of_the_file_near(path: Path) -> float:
    block = read_bal(path)
    return float((_residuals_px(block) ** 2).sum() / len(block.image_points))


def _image_points(block: Block) -> ip.ImagePoints:
    rows = block.image_points
    return ip.ImagePoints(
        images=ip.ImageIds(id=block.images.id),
        points=ip.PointIds(id=block.points.id),
        measurements=ip.Measurements(
            image=rows.image, point=rows.point, xy_mm=rows.xy, sigma_mm=rows.sigma_mm, active=rows.active
        ),
        interior=ip.Interior.empty(),
        fiducial_residuals=ip.FiducialResiduals.empty(),
        corrections=ip.Corrections(name=np.array(["distortion"]), largest_mm=np.array([0.0])),
        suspects=Suspects.empty(),
    )


@pytest.mark.parametrize(
    ("text", "where", "what"),
    [
        ("2 1\n", ":1", "does not begin with the numbers"),
        ("1 1 1.5\n", ":1", "does not begin with the numbers"),
        ("1 1 1\n0 0 1 x\n", ":2", "'x' is no number"),
        ("1 1 1\n0 0 1 2\n" + "1\n" * 11, ":13", "18 numbers where 1 camera, 1 point and 1 observation need 19"),
        ("1 1 1\n1 0 1 2\n" + "1\n" * 12, ":2", "camera 1, but there are 1"),
        ("1 1 1\n0 -1 1 2\n" + "1\n" * 12, ":2", "point -1, but there are 1"),
        ("1 1 1\n0 0 1 2\n" + "1\n" * 6 + "0\n" + "1\n" * 5, ":9", "focal length 0"),
    ],
)
def test_a_malformed_file_is_named(tmp_path: Path, text: str, where: str, what: str) -> None:
    path = tmp_path / "problem.txt"
    path.write_text(text)
    with pytest.raises(AatriError) as caught:
        read_bal(path)
    assert caught.value.exit_code == 3
    assert f"{path}{where}: " in str(caught.value)
    assert what in str(caught.value)
