"""DBAT's blocks through reader, interior orientation and bundle: the printed digits of its reports."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.errors import GeometryError, InputError
from aatri.geometry.rotations import angles_from_rotation, exp_rotation
from aatri.orientation.bundle.adjust import Datum
from aatri.stages.bundle_adjustment.bundle import BundleOptions, bundle
from aatri.stages.interior_orientation.calibrated import calibrated
from tests.formats.dbat.dbat_report import SXB_OFFSET_M, DbatReport, read_report
from tests.reading import read_dbat
from tests.stages.film_blocks import Told

CASES = ("f-op0", "w-op0", "w-op1")


def _sxb(shared_data: Path, case: str) -> tuple[Block, Solution, DbatReport]:
    folder = shared_data / "dbat" / "sxb"
    control = folder / ("ctrlpts-fixed.txt" if case.startswith("f") else "ctrlpts-weighted.txt")
    block = read_dbat(folder / f"{case}-no-orient-pmexport.txt", control)
    options = BundleOptions(tolerance=1e-8, blunders="none")
    return (
        block,
        bundle(block, calibrated(block), options=options),
        read_report(folder / f"{case}-no-orient-dbatreport.txt"),
    )


def _camcal(shared_data: Path, name: str = "camcal-pmexport", control: str | None = "camcal-fixed.txt") -> Block:
    folder = shared_data / "dbat" / "camcal"
    path = folder / control if control else None
    return read_dbat(folder / f"{name}.txt", path, camera_model="dbat3", calibrate=True)


def _poses(solution: Solution) -> tuple[np.ndarray, np.ndarray]:
    """omega phi kappa (degrees) X0 Y0 Z0, and their covariance a posteriori, by central differences of the angles."""
    R, covariance = solution.images.ground_from_image, solution.images.covariance
    h = 1e-6
    G = np.zeros((len(R), 6, 6))
    G[:, 3:, :3] = np.eye(3)
    for k in range(3):
        d = h * np.eye(3)[k]
        there, back = (angles_from_rotation(exp_rotation(np.tile(s * d, (len(R), 1))) @ R) for s in (1, -1))
        G[:, :3, 3 + k] = np.degrees(((there - back + np.pi) % (2 * np.pi) - np.pi) / (2 * h))
    values = np.hstack([np.degrees(angles_from_rotation(R)), solution.images.position_m])
    return values, solution.sigma0**2 * G @ covariance @ G.swapaxes(1, 2)


def _same_digits(found: float, printed: float, digits: int) -> bool:
    """Equal to the digits printed, where trailing zeros are not printed; half a unit of rounding more."""
    unit = 10.0 ** (np.floor(np.log10(abs(printed))) - digits + 1)
    return bool(abs(found - printed) <= 0.5001 * unit)


def _assert_poses(solution: Solution, report: DbatReport, offset_m: np.ndarray) -> None:
    values, covariance = _poses(solution)
    turned = values[:, :3] - report.exterior[:, :3]
    assert np.abs(turned - 360 * np.round(turned / 360)).max() < 6e-7
    sigma = np.sqrt(np.einsum("nii->ni", covariance))
    # half a unit of the last digit, and what DBAT's own criterion (step below 1e-6 of the residuals) leaves open
    apart = np.abs(values[:, 3:] - offset_m - report.exterior[:, 3:])
    assert (apart <= 6e-7 + 3e-6 * sigma[:, 3:]).all()
    for found, printed in zip(sigma.ravel(), report.exterior_sigma.ravel()):
        assert _same_digits(found, printed, 3), (found, printed)


def _offset_m(solution: Solution, report: DbatReport) -> np.ndarray:
    """What the report is reduced by: known to 1e-5 m from its export, to 1e-6 m from the positions themselves."""
    offset = (solution.images.position_m - report.exterior[:, 3:]).mean(axis=0)
    np.testing.assert_allclose(offset, SXB_OFFSET_M, rtol=0, atol=1e-5)
    return np.asarray(offset)


@pytest.mark.parametrize("case", CASES)
def test_the_aerial_block_gives_the_report_to_all_printed_digits(shared_data: Path, case: str) -> None:
    _, solution, report = _sxb(shared_data, case)
    assert (solution.observations, solution.unknowns, solution.redundancy) == report.counts
    assert _same_digits(solution.sigma0, report.sigma0, 6 if case != "f-op0" else 5)
    offset = _offset_m(solution, report)
    _assert_poses(solution, report, offset)
    row = {str(name): k for k, name in enumerate(solution.points.id)}
    assert len(report.control) == 16
    for name, xyz in report.control.items():
        np.testing.assert_allclose(solution.points.xyz_m[row[name]] - offset, xyz, rtol=0, atol=0.00051)
        sigma = solution.sigma0 * np.sqrt(np.diag(solution.points.covariance_m2[row[name]]))
        if case == "f-op0":
            assert (sigma == 0).all()
            continue
        for found, printed in zip(sigma, report.control_sigma[name]):
            assert _same_digits(found, printed, 3), (name, found, printed)


@pytest.mark.parametrize("case", CASES)
def test_correlations_of_poses_above_95_percent_are_those_printed(shared_data: Path, case: str) -> None:
    """All reports print the same for every photo: omega with Yc about -1, phi with Xc about +1, and no other."""
    covariance = _poses(_sxb(shared_data, case)[1])[1]
    sigma = np.sqrt(np.einsum("nii->ni", covariance))
    rho = covariance / (sigma[:, :, None] * sigma[:, None, :])
    for one in np.triu(rho, 1):
        pairs = {(int(i), int(j)): one[i, j] for i, j in np.argwhere(np.abs(one) > 0.95)}
        assert set(pairs) == {(0, 4), (1, 3)}
        assert -1 < pairs[0, 4] < -0.9994
        assert 0.9984 < pairs[1, 3] < 1


def test_the_calibration_gives_the_report_to_all_printed_digits(shared_data: Path) -> None:
    block = _camcal(shared_data)
    heard = Told()
    solution = bundle(block, calibrated(block), options=BundleOptions(blunders="none"), context=heard)
    report = read_report(shared_data / "dbat/camcal/camcal-dbatreport-model3.txt")
    assert (solution.observations, solution.unknowns, solution.redundancy) == report.counts
    assert f"{solution.sigma0:.5g}" == f"{report.sigma0:.5g}" == "1.6148"
    value = dict(zip(solution.parameters.name.tolist(), solution.parameters.value))
    sigma = dict(zip(solution.parameters.name.tolist(), solution.sigma0 * solution.parameters.sigma))
    size, pixel = block.cameras.format[0], block.cameras.pixel_size_mm[0]
    # px of a report counts from the left edge, py from the upper edge; parameters from the centre of the image
    value["principal_point.x"] += size[0] / 2 * pixel[0]
    value["principal_point.y"] = size[1] / 2 * pixel[1] - value["principal_point.y"]
    names = {"c": "principal_distance", "px": "principal_point.x", "py": "principal_point.y"}
    for short, printed in report.interior.items():
        name = names.get(short, short)
        assert _same_digits(value[name], printed, 6), (name, value[name], printed)
        assert _same_digits(sigma[name], report.interior_sigma[short], 3), (name, sigma[name])
    _assert_poses(solution, report, np.zeros(3))
    # "K2: correlations over 95 %: K3:-97.9 %", and no other
    told = [text for text in heard.warnings if "correlated" in text]
    assert len(told) == 1
    assert "k2 and k3 are correlated by -0.979" in told[0]


@pytest.mark.parametrize("control", ["camcal-fixed", "camcal-1mm"])
@pytest.mark.parametrize("other", ["1002", "1004"])
def test_two_exchanged_control_points_of_four_are_named_before_adjusting(
    shared_data: Path, tmp_path: Path, control: str, other: str
) -> None:
    """Exact they cannot be rejected, and weighted two points are left, which leave the datum open."""
    text = (shared_data / "dbat/camcal" / f"{control}.txt").read_text()
    rows = {line.split(",")[0]: line.split(",") for line in text.splitlines()}
    rows["1001"][2:5], rows[other][2:5] = rows[other][2:5], rows["1001"][2:5]
    path = tmp_path / "control.txt"
    path.write_text("".join(",".join(row) + "\n" for row in rows.values()))
    block = read_dbat(shared_data / "dbat/camcal/camcal-pmexport.txt", path, camera_model="dbat3", calibrate=True)
    with pytest.raises(InputError, match=f"1001 and {other} fit with their numbers exchanged") as caught:
        bundle(block, calibrated(block))
    assert caught.value.exit_code == 3
    assert "control.txt:" in str(caught.value)


@pytest.mark.parametrize("name", ["camcal-pmexport-1ray", "camcal-pmexport-missing-obs"])
def test_points_without_rays_are_refused(shared_data: Path, name: str) -> None:
    with pytest.raises(Exception, match=r"is seen in (one image only|no image)") as caught:
        _camcal(shared_data, name)
    assert getattr(caught.value, "exit_code", None) == 4


@pytest.mark.slow
def test_without_datum_the_seven_defects_are_named(shared_data: Path) -> None:
    block = _camcal(shared_data, control=None)
    with pytest.raises(GeometryError, match="leave 7 unknown") as caught:
        bundle(block, calibrated(block), options=BundleOptions(blunders="none"))
    assert caught.value.exit_code == 4
    assert "datum: minimal" in str(caught.value)


@pytest.mark.slow(after=1)
@pytest.mark.parametrize("datum", ["minimal", "free"])
def test_a_datum_without_control_leaves_sigma0_and_the_camera_as_they_are(shared_data: Path, datum: Datum) -> None:
    """The four control points of the calibration are exact: 12 coordinates, 5 more than the datum needs."""
    block = _camcal(shared_data, control=None)
    solution = bundle(block, calibrated(block), options=BundleOptions(datum=datum, blunders="none"))
    assert solution.redundancy == 4148 - (423 + 12 - 7)
    c = solution.parameters.value[solution.parameters.name == "principal_distance"][0]
    report = read_report(shared_data / "dbat/camcal/camcal-dbatreport-model3.txt")
    assert abs(c - report.interior["c"]) < 4 * report.interior_sigma["c"]


@pytest.mark.slow
@pytest.mark.parametrize("mirror", [[1.0, -1.0], [-1.0, 1.0]])
def test_mirrored_images_that_a_free_camera_takes_up_are_told(shared_data: Path, mirror: list[float]) -> None:
    """The test field is flat: all fits as before with an aspect of -2, or a c of -7.457 mm too."""
    block, told = _camcal(shared_data), Told()
    points, size = block.image_points, block.cameras.format[0]
    block = replace(block, image_points=replace(points, xy=size / 2 + (points.xy - size / 2) * mirror))
    bundle(block, calibrated(block), context=told)
    (text,) = [text for text in told.warnings if "mirrored: " in text]
    assert ("c -7.457" in text) == (mirror[1] < 0)
    assert "as -2.000" in text
    assert "y axis of its image coordinates" in text
