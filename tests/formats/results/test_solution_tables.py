"""A Solution as tables: its CRS, its interior orientation."""

from __future__ import annotations

import csv
import dataclasses
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts import block as b
from aatri.artifacts.evaluation import Differences, Evaluation, Figures, SingleModels
from aatri.artifacts.solution import Parameters, PointCovariances, ProposedNumbers, Uncontrolled
from aatri.errors import ResourceError
from aatri.formats.results.exported_files import write_crs
from aatri.formats.results.solution_tables import point_roles, write_evaluation_tables, write_solution_tables
from aatri.geometry.rotations import rotation_from_angles
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from tests.made_solutions import made_block, made_solution
from tests.stages.bundle_adjustment.test_given_in_part import cells, exterior
from tests.stages.hand_block import C_MM, PRINCIPAL_POINT_MM, Hand, ground_rows, hand, read, start

# The CSV tables of a Solution.


def _read(path: Path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_numbers_read_back_to_the_same_bits(tmp_path: Path) -> None:
    block = made_block()
    shift = np.random.default_rng(1).normal(0, 0.1, (20, 3))
    solution = made_solution(block, shift_m=shift)
    write_solution_tables(solution, block, tmp_path / "out")
    rows = _read(tmp_path / "out" / "points.csv")
    read = np.array([[float(row[axis]) for axis in ("X_m", "Y_m", "Z_m")] for row in rows])
    np.testing.assert_array_equal(read, solution.points.xyz_m)
    assert {row["sX_m"] for row in rows} == {"0.02"}


def test_covariances_of_points_between_them_and_of_orientations_are_tables(tmp_path: Path) -> None:
    block = made_block()
    solution = made_solution(block)
    matrix = np.arange(9.0).reshape(3, 3)
    own = solution.points.covariance_m2[:1]
    pairs = PointCovariances.of(first=[0, 0], second=[0, 2], covariance_m2=np.concatenate([own, [matrix]]))
    write_solution_tables(dataclasses.replace(solution, point_covariances=pairs), block, tmp_path)
    rows = _read(tmp_path / "point_covariances.csv")
    assert len(rows) == len(solution.points) + 1
    ids = solution.points.id.tolist()
    assert [rows[-1]["point_1"], rows[-1]["point_2"]] == [ids[0], ids[2]]
    names = [f"{i}{j}_m2" for i in "XYZ" for j in "XYZ"]
    assert [float(rows[-1][name]) for name in names] == matrix.ravel().tolist()
    assert [float(rows[1][name]) for name in names] == solution.points.covariance_m2[1].ravel().tolist()
    images = _read(tmp_path / "image_covariances.csv")
    read = [float(images[0][name]) for name in images[0] if name != "image"]
    assert read == solution.images.covariance[0][np.triu_indices(6)].tolist()


def test_both_angle_systems_are_in_degrees_and_kappa_takes_the_whole_turn(tmp_path: Path) -> None:
    block = made_block()
    solution = made_solution(block)
    angles = np.radians(np.tile([1.0, -2.0, 170.0], (len(block.images), 1)))
    images = dataclasses.replace(solution.images, ground_from_image=rotation_from_angles(angles))
    write_solution_tables(dataclasses.replace(solution, images=images), block, tmp_path)
    row = _read(tmp_path / "exterior.csv")[0]
    opk = [float(row[name]) for name in ("omega_deg", "phi_deg", "kappa_deg")]
    assert opk == pytest.approx([1.0, -2.0, 170.0])
    pok = np.radians([float(row[name]) for name in ("phi_pok_deg", "omega_pok_deg", "kappa_pok_deg")])
    np.testing.assert_allclose(rotation_from_angles(pok, "phi-omega-kappa"), images.ground_from_image[0], atol=1e-14)


def test_near_vertical_angle_sigmas_are_those_of_the_increments(tmp_path: Path) -> None:
    block = made_block()
    write_solution_tables(made_solution(block), block, tmp_path)
    row = _read(tmp_path / "exterior.csv")[0]
    for name in ("somega_deg", "sphi_deg", "skappa_deg", "sphi_pok_deg", "somega_pok_deg", "skappa_pok_deg"):
        assert float(row[name]) == pytest.approx(np.degrees(1e-5), rel=1e-9)
    assert float(row["sX_m"]) == pytest.approx(0.01)


def test_what_is_not_determined_is_an_empty_cell(tmp_path: Path) -> None:
    block = made_block()
    shift = np.zeros((20, 3))
    shift[0] = np.nan
    solution = made_solution(block, shift_m=shift)
    oriented = np.arange(len(block.images)) > 0
    images = dataclasses.replace(
        solution.images,
        oriented=oriented,
        ground_from_image=np.where(oriented[:, None, None], solution.images.ground_from_image, np.nan),
        position_m=np.where(oriented[:, None], solution.images.position_m, np.nan),
        covariance=np.where(oriented[:, None, None], solution.images.covariance, np.nan),
    )
    write_solution_tables(dataclasses.replace(solution, images=images), block, tmp_path)
    point, image = _read(tmp_path / "points.csv")[0], _read(tmp_path / "exterior.csv")[0]
    assert [point["X_m"], point["Y_m"], point["Z_m"]] == ["", "", ""]
    assert {value for name, value in image.items() if name not in ("image", "image_points")} == {""}
    assert _read(tmp_path / "residuals.csv")[0]["vz"] == ""


def test_residuals_carry_their_unit(tmp_path: Path) -> None:
    block = made_block()
    write_solution_tables(made_solution(block), block, tmp_path)
    units = {(row["kind"], row["unit"]) for row in _read(tmp_path / "residuals.csv")}
    assert units == {("image_point", "mm"), ("control", "m")}


@pytest.mark.parametrize("text", ["=cmd|' /C calc'!A0", "+1", "-2", "@SUM(A1)", "\t=1"])
def test_a_text_that_looks_like_a_formula_is_prefixed_and_a_number_is_not(tmp_path: Path, text: str) -> None:
    block = made_block()
    names = block.points.id.astype("U32")
    solution = made_solution(block, shift_m=[-1000.0, 0.0, 0.0])
    names[0] = text
    points = dataclasses.replace(solution.points, id=names)
    write_solution_tables(dataclasses.replace(solution, points=points), block, tmp_path)
    row = _read(tmp_path / "points.csv")[0]
    assert row["point"] == "'" + text
    assert row["X_m"] == "-1000.0"


def test_roles_are_written_as_in_the_block_folder() -> None:
    block = made_block()
    role = block.ground_points.role.copy()
    role[0] = [b.CONTROL, b.CONTROL, b.CHECK]
    role[1] = [b.NO_ROLE, b.NO_ROLE, b.CONTROL]
    block = dataclasses.replace(block, ground_points=dataclasses.replace(block.ground_points, role=role))
    roles = point_roles(block)[block.ground_points.point]
    assert roles[:4].tolist() == ["XY:control Z:check", "Z:control", "check", "check"]
    assert (point_roles(block) == "").sum() == 12


def test_parameters_have_a_table_only_if_there_are_any(tmp_path: Path) -> None:
    block = made_block()
    without = write_solution_tables(made_solution(block), block, tmp_path / "a")
    assert [path.name for path in without] == [
        "exterior.csv",
        "points.csv",
        "cameras.csv",
        "residuals.csv",
        "frame.csv",
        "point_covariances.csv",
        "image_covariances.csv",
    ]
    parameters = Parameters(group=["interior"], object=["1-0"], name=["d0"], value=[1e-3], sigma=[np.nan])
    solution = made_solution(block, parameters=parameters)
    assert "parameters.csv" in [path.name for path in write_solution_tables(solution, block, tmp_path / "b")]
    assert _read(tmp_path / "b" / "parameters.csv")[0]["sigma"] == ""


def test_a_folder_that_cannot_be_made_is_an_error_with_its_place(tmp_path: Path) -> None:
    block = made_block()
    (tmp_path / "file").write_text("")
    with pytest.raises(ResourceError, match="file"):
        write_solution_tables(made_solution(block), block, tmp_path / "file")


def test_what_nothing_controls_and_proposed_numbers_have_tables_if_there_are_any(tmp_path: Path) -> None:
    block = made_block()
    uncontrolled = Uncontrolled(
        kind=["control"], row=[0], image=[""], point=["p1"], redundancy=[0.004], direction=[[0.6, 0.8, np.nan]]
    )
    proposed = ProposedNumbers(
        kind=["image_point"], row=[3], image=["1-0"], point=["p1"], proposed=["p2"], exchanged=[True]
    )
    solution = dataclasses.replace(made_solution(block), uncontrolled=uncontrolled, proposed_numbers=proposed)
    write_solution_tables(solution, block, tmp_path)
    (row,) = _read(tmp_path / "uncontrolled.csv")
    assert (row["point"], row["redundancy"], row["direction_y"], row["direction_z"]) == ("p1", "0.004", "0.8", "")
    (row,) = _read(tmp_path / "proposed_numbers.csv")
    assert (row["point"], row["proposed"], row["exchanged"]) == ("p1", "p2", "yes")
    nothing = dataclasses.replace(solution, uncontrolled=Uncontrolled.empty(), proposed_numbers=ProposedNumbers.empty())
    names = [path.name for path in write_solution_tables(nothing, block, tmp_path / "none")]
    assert "uncontrolled.csv" not in names
    assert "proposed_numbers.csv" not in names


def test_an_evaluation_has_tables_of_figures_differences_and_single_models(tmp_path: Path) -> None:
    three = [[0.1, np.nan, -0.3]]
    evaluation = Evaluation(
        verdict="",
        figures=Figures(name=["check_rmse_x_m"], value=[0.25]),
        differences=Differences(point=["p1"], kind=["check"], difference_m=three, sigma_m=three, rays=[3]),
        models=SingleModels(
            left=["1"],
            right=["2"],
            points=[7],
            base_m=[500.0],
            parallax_rms_um=[4.5],
            parallax_max_um=[9.0],
            parallax_max_at=["p1"],
            w_rms=[np.nan],
            adjusted_rms_m=three,
            control_points=[0],
            control_rms_m=three,
            check_points=[1],
            check_rms_m=three,
        ),
    )
    names = [path.name for path in write_evaluation_tables(evaluation, tmp_path)]
    assert names == ["figures.csv", "differences.csv", "models.csv"]
    assert _read(tmp_path / "figures.csv") == [{"name": "check_rmse_x_m", "value": "0.25"}]
    (row,) = _read(tmp_path / "differences.csv")
    assert (row["dX_m"], row["dY_m"], row["sZ_m"], row["rays"]) == ("0.1", "", "-0.3", "3")
    (row,) = _read(tmp_path / "models.csv")
    assert (row["right"], row["parallax_rms_um"], row["w_rms"], row["check_rms_z_m"]) == ("2", "4.5", "", "-0.3")


# The coordinate system stands beside exports that have no place for it.


def test_a_declared_system_is_written_and_a_local_one_is_none(tmp_path: Path) -> None:
    block = made_block()
    write_crs(block, tmp_path)
    assert list(tmp_path.iterdir()) == []
    frames = replace(
        block.frames, crs=np.array(["EPSG:32650"]), vertical=np.array(["EPSG:5773"]), axes=np.array(["north,east,up"])
    )
    write_crs(replace(block, frames=frames), tmp_path)
    assert (tmp_path / "crs.txt").read_text() == "crs: EPSG:32650\nvertical: EPSG:5773\naxes: east,north,up\nunit: m\n"


# Interior orientations as they are told: absolute, with covariances, in the convention of the camera.

TRUE = np.array([C_MM + 0.05, *(PRINCIPAL_POINT_MM + np.array([0.03, -0.04]))])
"""What the block, whose rays were made with C_MM, has if its nominal camera is off by the difference."""


@pytest.fixture(scope="module")
def of() -> Hand:
    return hand()


@pytest.mark.parametrize("way", ["model", "set"])
def test_an_interior_orientation_is_told_as_adjusted(of: Hand, way: str, tmp_path: Path) -> None:
    """The rays are those of a camera whose c and principal point are others than the block says."""
    rows = [cells(of, k) | dict.fromkeys(("sX", "sY", "sZ"), 0.001) for k in range(6)]
    seen = of.xy_mm * TRUE[0] / C_MM + TRUE[1:] - PRINCIPAL_POINT_MM
    sigmas = {"principal_distance": float("inf"), "principal_point": [float("inf"), 0.5]}
    camera = {"sigmas": sigmas} if way == "model" else {}
    block, points = read(
        tmp_path / "b", of, ground=ground_rows(of, range(30)), exterior=exterior(rows), xy_mm=seen, camera=camera
    )
    options = {} if way == "model" else {"self_calibration": {"set": "brown_conrady"}}
    found = bundle(block, points, start(of, block), options=BundleOptions(blunders="none", tolerance=1e-6, **options))
    np.testing.assert_allclose(found.cameras.principal_distance_mm, TRUE[:1], atol=3e-4)
    np.testing.assert_allclose(found.cameras.principal_point_mm[0], TRUE[1:], atol=3e-4)
    if way == "model":
        p = dict(zip(found.parameters.name.tolist(), found.parameters.value.tolist()))
        np.testing.assert_allclose([p["principal_point.x"], p["principal_point.y"]], TRUE[1:], atol=3e-4)
        again = replace(block, cameras=replace(block.cameras, principal_point_mm=np.array([[0.0, 0.5]])))
        at_zero = replace(points, measurements=replace(points.measurements, xy_mm=seen + PRINCIPAL_POINT_MM - [0, 0.5]))
        same = bundle(again, at_zero, start(of, block), found, options=BundleOptions(blunders="none", tolerance=1e-6))
        np.testing.assert_allclose(same.cameras.principal_point_mm[0], TRUE[1:], atol=3e-4)
    write_solution_tables(found, block, tmp_path / "out")
    (row,) = csv.DictReader((tmp_path / "out" / "cameras.csv").read_text().splitlines())
    assert float(row["principal_point_x_mm"]) == found.cameras.principal_point_mm[0, 0]
    names = ("c", "x0", "y0") if way == "set" else ("principal_distance", "principal_point.x", "principal_point.y")
    sigma = dict(zip(found.parameters.name.tolist(), found.parameters.sigma.tolist()))
    for column, name in zip(("principal_distance", "principal_point_x", "principal_point_y"), names):
        assert float(row[f"s{column}_mm"]) == pytest.approx(sigma[name], rel=2e-3)
    cofactor = float(row["covariance_principal_point_x_principal_point_y_mm2"])
    assert abs(cofactor) < sigma[names[1]] * sigma[names[2]]
    assert row["convention"].startswith("principal point from the fiducial centre, x right, y up")
