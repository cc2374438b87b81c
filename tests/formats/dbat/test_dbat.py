"""DBAT's files: the real exports against DBAT's own reports, and what must happen to malformed lines."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.block import APPROXIMATE, CONTROL, Block
from aatri.errors import AatriError, GeometryError
from aatri.formats.dbat.files import read_export
from aatri.geometry.collinearity import collinearity
from aatri.geometry.rotations import angle_covariance, angles_from_rotation, exp_rotation, rotation_from_angles
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.formats.dbat.dbat_report import SXB_OFFSET_M, DbatReport, read_report
from tests.reading import read_dbat
from tests.stages.film_blocks import Told

DBAT = "dbat"


def _sxb(shared_data: Path, case: str) -> tuple[Block, DbatReport]:
    folder = shared_data / DBAT / "sxb"
    control = folder / ("ctrlpts-fixed.txt" if case.startswith("f") else "ctrlpts-weighted.txt")
    block = read_dbat(folder / f"{case}-no-orient-pmexport.txt", control)
    return block, read_report(folder / f"{case}-no-orient-dbatreport.txt")


def _camcal(shared_data: Path, name: str = "camcal-pmexport", control: str | None = "camcal-fixed.txt") -> Block:
    folder = shared_data / DBAT / "camcal"
    return read_dbat(
        folder / f"{name}.txt", folder / control if control else None, camera_model="dbat3", calibrate=True
    )


def _corrected_mm(block: Block, interior: np.ndarray) -> np.ndarray:
    """Corrected coordinates, by the equations in the docstring of the reader: c x0 y0 k1 k2 k3 p1 p2 as."""
    size, pixel = block.cameras.format[0], block.cameras.pixel_size_mm[0]
    photo = (block.image_points.xy - size / 2) * pixel * np.array([1, -1])
    _, x0, y0, k1, k2, k3, p1, p2, aspect = interior
    x, y = (1 + aspect) * (photo[:, 0] - x0), photo[:, 1] - y0
    r2 = x**2 + y**2
    radial = k1 * r2 + k2 * r2**2 + k3 * r2**3
    dx = x * radial + p1 * (r2 + 2 * x**2) + 2 * p2 * x * y
    dy = y * radial + p2 * (r2 + 2 * y**2) + 2 * p1 * x * y
    return np.stack([x + dx, y + dy], axis=1)


def _interior(block: Block) -> np.ndarray:
    values = dict(zip(block.camera_parameters.name.tolist(), block.camera_parameters.value.tolist()))
    names = ("k1", "k2", "k3", "p1", "p2", "as")
    cameras = block.cameras
    return np.array(
        [cameras.principal_distance_mm[0], *cameras.principal_point_mm[0], *(values.get(name, 0.0) for name in names)]
    )


@pytest.mark.parametrize("case", ["f-op0", "w-op0", "w-op1"])
def test_the_residuals_at_the_printed_solution_give_the_printed_sigma0(shared_data: Path, case: str) -> None:
    block, report = _sxb(shared_data, case)
    assert block.images.id.tolist() == report.photos
    ground = block.ground_points
    X = np.full((len(block.points), 3), np.nan)
    X[ground.point] = ground.xyz_m - SXB_OFFSET_M
    squares = 0.0
    if case != "f-op0":
        # the export has the adjusted points with five decimals, the report with three
        for name, point in read_export(shared_data / DBAT / f"sxb/{case}-no-orient-pmexport.txt").control.items():
            xyz = np.array(point.xyz_m)
            np.testing.assert_allclose(xyz, report.control[name], rtol=0, atol=0.00051)
            row = ground.point.tolist().index(block.points.id.tolist().index(name))
            sigma = np.sqrt(np.diag(ground.covariance_m2[row]))
            squares += float((((xyz - X[ground.point[row]]) / sigma) ** 2).sum())
            X[ground.point[row]] = xyz
    xy_mm, _, _ = collinearity(
        report.exterior[block.image_points.image, 3:],
        rotation_from_angles(np.radians(report.exterior[block.image_points.image, :3])),
        X[block.image_points.point],
        np.full(len(block.image_points), block.cameras.principal_distance_mm[0]),
    )
    residual = (xy_mm - _corrected_mm(block, _interior(block))) / block.image_points.sigma_mm
    squares += float((residual**2).sum())
    sigma0 = np.sqrt(squares / report.counts[2])
    assert sigma0 == pytest.approx(report.sigma0, abs=1e-6 if case != "f-op0" else 5e-5)  # half a digit, or little more
    # DBAT prints the RMS length of the residual vectors
    assert np.sqrt((residual**2).sum(axis=1).mean()) == pytest.approx(report.residual_rms_px, abs=6e-4)


def test_model_1_takes_pixels_as_square_and_says_so(shared_data: Path) -> None:
    """DBAT's prob2dbatstruct.m: `use y as the pixel size, store diff as aspect`; its model 1 has no aspect."""
    folder, told = shared_data / DBAT / "camcal", Told()
    block = read_dbat(folder / "camcal-pmexport.txt", folder / "camcal-fixed.txt", camera_model="brown", reporter=told)
    height = 5.43764 / 1704
    u, v = block.image_points.xy.T
    expected = np.stack([height * u - 3.6173, 2.6128 - height * v], axis=1)
    np.testing.assert_allclose(calibrated(block).measurements.xy_mm, expected, rtol=0, atol=1e-12)
    assert (block.image_points.sigma_mm == block.image_points.sigma_mm[:, :1]).all()
    assert any("+0.041 % wider than high, 0.47 px at the edge" in text for text in told.warnings)


def test_square_pixels_are_not_warned_of(shared_data: Path) -> None:
    folder, told = shared_data / DBAT / "sxb", Told()
    read_dbat(folder / "f-op0-no-orient-pmexport.txt", folder / "ctrlpts-fixed.txt", reporter=told)
    assert not [text for text in told.warnings if "wider" in text]


def test_counts_roles_and_standard_deviations_are_those_of_the_reports(shared_data: Path) -> None:
    for case in ("f-op0", "w-op0", "w-op1"):
        block, report = _sxb(shared_data, case)
        control = (block.ground_points.role == CONTROL).all(axis=1)
        weighted = 0 if case == "f-op0" else 3 * int(control.sum())
        unknowns = 6 * len(block.images) + weighted + 3 * int((~control).sum())
        assert (2 * len(block.image_points) + weighted, unknowns) == report.counts[:2]
        sigma = np.sqrt(np.diagonal(block.ground_points.covariance_m2[control], axis1=1, axis2=2))
        assert (sigma == ([0, 0, 0] if case == "f-op0" else [0.02, 0.02, 0.04])).all()
        assert (block.ground_points.role[~control] == APPROXIMATE).all()
        assert len(block.rejects) == 0


def test_start_values_are_in_the_frame_of_the_control(shared_data: Path) -> None:
    block, report = _sxb(shared_data, "w-op1")
    # the export holds the final values, rounded to mm and 0.001 degree
    np.testing.assert_allclose(block.exterior.position_m, report.exterior[:, 3:] + SXB_OFFSET_M, rtol=0, atol=0.0006)
    np.testing.assert_allclose(np.degrees(block.exterior.angles_rad), report.exterior[:, :3], rtol=0, atol=0.00051)
    row = block.points.id.tolist().index("745")
    xyz = block.ground_points.xyz_m[block.ground_points.point.tolist().index(row)]
    np.testing.assert_allclose(xyz - SXB_OFFSET_M, [227.85194, 384.03959, 20.36831], rtol=0, atol=1e-4)


def _adjust(block: Block) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]:
    """Dense Gauss-Newton over the tables of the Block: interior, rotations, positions, covariance, sigma0."""
    points = block.image_points
    i, j = points.image, points.point
    interior = _interior(block)
    R = rotation_from_angles(block.exterior.angles_rad)
    X0, X = block.exterior.position_m.copy(), np.zeros((len(block.points), 3))
    X[block.ground_points.point] = block.ground_points.xyz_m
    fixed = np.zeros(len(X), dtype=bool)
    fixed[block.ground_points.point] = (block.ground_points.role == CONTROL).any(axis=1)
    column = np.cumsum(~fixed) - 1
    first_point, rays = 9 + 6 * len(X0), np.arange(len(i))
    for _ in range(6):
        xy, by_pose, by_point = collinearity(X0[i], R[i], X[j], np.full(len(i), interior[0]))
        A = np.zeros((len(i), 2, first_point + 3 * int((~fixed).sum())))
        A[:, :, 0] = xy / interior[0]
        for k in range(1, 9):
            step = interior.astype(complex)
            step[k] += 1e-30j
            A[:, :, k] = -_corrected_mm(block, step).imag / 1e-30
        free = ~fixed[j]
        for k in range(6):
            A[rays, :, 9 + 6 * i + k] = by_pose[:, :, k]
        for k in range(3):
            A[rays[free], :, first_point + 3 * column[j[free]] + k] = by_point[free][:, :, k]
        whitened = (A / points.sigma_mm[:, :, None]).reshape(2 * len(i), -1)
        residual = ((xy - _corrected_mm(block, interior)) / points.sigma_mm).reshape(-1)
        scale = 1 / np.linalg.norm(whitened, axis=0)
        N = (whitened * scale).T @ (whitened * scale)
        step = -scale * np.linalg.solve(N, scale * (whitened.T @ residual))
        interior = interior + step[:9]
        pose = step[9:first_point].reshape(-1, 6)
        X0, R = X0 + pose[:, :3], exp_rotation(pose[:, 3:]) @ R
        X[~fixed] += step[first_point:].reshape(-1, 3)
    redundancy = len(residual) - len(scale)
    sigma0 = float(np.sqrt(residual @ residual / redundancy))
    covariance = np.linalg.inv(N)[:first_point, :first_point] * np.outer(scale[:first_point], scale[:first_point])
    return interior, R, X0, covariance * sigma0**2, sigma0


@pytest.mark.slow
def test_adjusting_the_calibration_block_gives_the_report_to_all_printed_digits(shared_data: Path) -> None:
    block = _camcal(shared_data)
    report = read_report(shared_data / DBAT / "camcal/camcal-dbatreport-model3.txt")
    interior, R, X0, covariance, sigma0 = _adjust(block)
    assert (2 * len(block.image_points), 9 + 6 * 21 + 3 * 96) == report.counts[:2]
    assert f"{sigma0:.5g}" == f"{report.sigma0:.5g}" == "1.6148"
    size, pixel = block.cameras.format[0], block.cameras.pixel_size_mm[0]
    found = dict(zip(("c", "px", "py", "k1", "k2", "k3", "p1", "p2", "as"), interior))
    found["px"] += size[0] / 2 * pixel[0]
    found["py"] = size[1] / 2 * pixel[1] - found["py"]
    sigma = dict(zip(found, np.sqrt(np.diag(covariance))))
    for name, value in report.interior.items():
        assert f"{found[name]:.6g}" == f"{value:.6g}", name
        assert f"{sigma[name]:.3g}" == f"{report.interior_sigma[name]:.3g}", name
    np.testing.assert_allclose(X0, report.exterior[:, 3:], rtol=0, atol=6e-7)
    turned = np.degrees(angles_from_rotation(R)) - report.exterior[:, :3]
    assert np.abs(turned - 360 * np.round(turned / 360)).max() < 6e-7
    blocks = covariance[9:, 9:].reshape(21, 6, 21, 6)[range(21), :, range(21)]
    angle_sigma = np.degrees(
        np.sqrt(np.diagonal(angle_covariance(R, blocks[:, 3:, 3:], "omega-phi-kappa"), axis1=1, axis2=2))
    )
    position_sigma = np.sqrt(np.diagonal(blocks[:, :3, :3], axis1=1, axis2=2))
    np.testing.assert_allclose(np.hstack([angle_sigma, position_sigma]), report.exterior_sigma, rtol=5e-3)


def test_the_calibration_has_its_parameters_free(shared_data: Path) -> None:
    parameters = _camcal(shared_data).camera_parameters
    assert parameters.name.tolist() == [
        "as",
        "k1",
        "k2",
        "k3",
        "p1",
        "p2",
        "principal_distance",
        "principal_point.x",
        "principal_point.y",
    ]
    assert parameters.free.all()
    assert parameters.value[:3].tolist() == pytest.approx([7.25319 / 2272 * 1704 / 5.43764 - 1, 0.00498, -0.0001])


@pytest.mark.parametrize(
    ("name", "points", "reason"),
    [
        ("camcal-pmexport-1ray", ["88"], "seen in one image only"),
        ("camcal-pmexport-missing-obs", ["13", "60"], "seen in no image"),  # DBAT: columns OX-12/13 and OX-59/60
    ],
)
def test_points_that_are_not_determined_are_refused_with_the_reason(
    shared_data: Path, name: str, points: list[str], reason: str
) -> None:
    with pytest.raises(AatriError) as caught:
        _camcal(shared_data, name)
    assert caught.value.exit_code == GeometryError.exit_code
    assert re.findall(r"object point (\d+) is", str(caught.value)) == points
    assert reason in str(caught.value)
    folder = shared_data / DBAT / "camcal"
    block = read_dbat(folder / f"{name}.txt", folder / "camcal-fixed.txt", set_aside=True)
    assert [p.split("/")[-1] for p in block.rejects.id.tolist()] == points
    assert set(block.rejects.reason.tolist()) == {reason}


def test_without_a_control_file_no_point_is_control(shared_data: Path) -> None:
    block = _camcal(shared_data, control=None)
    assert not (block.ground_points.role == CONTROL).any()


def test_one_standard_deviation_in_the_control_file_holds_for_all_coordinates(shared_data: Path) -> None:
    block = _camcal(shared_data, control="camcal-1mm.txt")
    control = (block.ground_points.role == CONTROL).all(axis=1)
    np.testing.assert_allclose(block.ground_points.covariance_m2[control], np.eye(3)[None] * np.ones((4, 1, 1)) * 1e-6)


def test_an_image_sigma_given_replaces_those_of_the_marks(shared_data: Path) -> None:
    export, pixel_mm = shared_data / DBAT / "camcal/camcal-pmexport.txt", 5.43764 / 1704
    for given, sigma_px in ((None, 0.1), (0.5, 0.5)):
        block = read_dbat(export, image_sigma_px=given, camera_model="dbat3")
        np.testing.assert_allclose(block.image_points.sigma_mm, sigma_px * pixel_mm, rtol=1e-14)


@pytest.mark.parametrize(
    ("old", "new", "line", "what"),
    [
        (" 0.000500 20 8858 12996", " 0.000500 20 8858", ":2", "3 words"),
        ("123.9392 26.5770", "-123.9392 26.5770", ":4", "not all positive"),
        ("   1 data/prague2016/sxb/images/8936.jpg", "   2 data/8936.jpg", ":12", "where photo 1 should begin"),
        ("images/8936.jpg", "images/8811.jpg", ":13", "photo 8811.jpg twice, first in line 7"),
        ("   1 123.939  26.577", "   1 123.999  26.577", ":16", "another camera"),
        ("2158.2500 1135.5000", "2158,2500 1135.5000", ":71", "2158,2500"),
        ("   0      333 2158.2500", "   7      333 2158.2500", ":71", "photo 7, but the photos are 0 to 4"),
        ("1135.5000  1.00000", "1135.5000  0.00000", ":71", "standard deviations 0"),
        ("     333  354.99369", "     317  354.99369", ":38", "point 317 twice, first in line 37"),
    ],
)
def test_a_malformed_line_is_named(shared_data: Path, tmp_path: Path, old: str, new: str, line: str, what: str) -> None:
    folder = shared_data / DBAT / "sxb"
    text = (folder / "f-op0-no-orient-pmexport.txt").read_text()
    assert old in text
    path = tmp_path / "export.txt"
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(AatriError) as caught:
        read_dbat(path, folder / "ctrlpts-fixed.txt")
    assert caught.value.exit_code == 3
    assert f"{path}{line}: " in str(caught.value)
    assert what in str(caught.value)


def test_faults_of_a_control_file_are_named_together(shared_data: Path, tmp_path: Path) -> None:
    folder = shared_data / DBAT / "sxb"
    export = tmp_path / "export.txt"
    shutil.copyfile(folder / "f-op0-no-orient-pmexport.txt", export)
    control = tmp_path / "control.txt"
    control.write_text(
        "# id, name, X, Y, Z\n317, a, 1, 2, 3\n317, b, 1, 2, 3\n333, c, 1, 2, 3, 1, 2\n375, d, 1, 2, 3, -1\n"
    )
    with pytest.raises(AatriError) as caught:
        read_dbat(export, control)
    for part in ("317 twice, first in line 2", f"{control}:4: 7 values", "a standard deviation of -1"):
        assert part in str(caught.value)
    control.write_text("3170, a, 1, 2, 3\n")
    with pytest.raises(AatriError, match="no control point is an object point"):
        read_dbat(export, control)
