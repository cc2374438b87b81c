"""Affine transformations onto fiducial marks: published examples, closed forms, gross errors."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from aatri.orientation.interior.affine import affine_from_fiducials, residual_correlation, snooped_affine, transform

CORNERS = np.array([[106.002, -106.003], [-106.001, -106.004], [-106.0, 106.002], [105.999, 106.002]])
SIDES = np.array([[112.001, 0.002], [-111.999, -0.001], [0.003, 112.002], [-0.002, -112.001]])


def fit(measured: np.ndarray, calibrated: np.ndarray, sigma_mm: float = 0.001, snooped: bool = False) -> Any:
    one = (measured[None], calibrated[None], np.full((1, *calibrated.shape), sigma_mm))
    method = snooped_affine if snooped else affine_from_fiducials
    return method(*one, np.ones((1, len(calibrated)), dtype=bool))


@pytest.fixture
def example(shared_data: Path) -> Any:
    """Worked examples of published and student solutions, by id."""
    text = (shared_data / "worked_examples/interior_orientation.yaml").read_text()
    return {entry["id"]: entry for entry in yaml.safe_load(text)}.__getitem__


def test_eight_marks_of_an_lps_block_file(example: Any) -> None:
    given = example("lps_bole_4092_affine")
    found = fit(np.array(given["pixel"]), np.array(given["film_mm"]))
    (tx, ax, bx), (ty, ay, by) = given["answer"]["x"], given["answer"]["y"]
    assert found.matrix[0] == pytest.approx(np.array([[ax, bx, tx], [ay, by, ty]]), rel=1e-9)
    assert found.redundancy[0] == 10
    assert np.sqrt((found.residual_mm**2).mean()) == pytest.approx(given["answer"]["rms_mm_per_coord"], abs=5e-6)


def test_parameters_and_variances_of_the_noobeed_report(example: Any) -> None:
    given = example("noobeed_affine_weighted")
    answer = given["answer"]
    a, d = answer["a"], answer["d"]
    sigma = np.hypot(given["film_sd_mm"], given["pixel_sd"] * np.sqrt(a * d))
    found = fit(np.array(given["pixel"]), np.array(given["film_mm"]), sigma)
    wanted = np.array([[a, answer["b"], answer["Cx"]], [answer["c"], d, answer["Cy"]]])
    assert found.matrix[0, :, :2] == pytest.approx(wanted[:, :2], abs=2e-12)
    assert found.matrix[0, :, 2] == pytest.approx(wanted[:, 2], abs=5e-4)
    # dx = d1 x with x = a X: the variance of a is that of d1 times a^2, there scaled by sigma0^2
    variance = found.sigma0[0] ** 2 * np.diag(found.covariance[0])
    assert variance[1] * a**2 == pytest.approx(answer["var_a"], rel=2e-3)
    assert variance[5] * d**2 == pytest.approx(answer["var_d"], rel=2e-3)


def test_four_marks_of_photo_319(example: Any) -> None:
    given = example("whu_0319_affine_4fid")
    found = fit(np.array(given["pixel"]) * [0.021, -0.021], np.array(given["film_mm"]))
    m, n = given["answer"]["m"], given["answer"]["n"]
    # there the y coordinate counts down: x = m0 + m1 u + m2 (-v)
    assert found.matrix[0] == pytest.approx(np.array([[m[1], m[2], m[0]], [n[1], n[2], n[0]]]), abs=5e-6)
    assert 1e-3 * found.sigma0[0] == pytest.approx(given["answer"]["rms_mm"], abs=5e-6)
    # printed as calibrated minus transformed
    assert -found.residual_mm[0] == pytest.approx(np.array(given["answer"]["film_residual_mm"]), abs=1e-5)
    assert found.redundancy[0] == 2


@pytest.mark.parametrize(("photo", "sigma0_um"), [("3574", 6.9), ("3575", 6.4)])
def test_rc30_pair(shared_data: Path, photo: str, sigma0_um: float) -> None:
    # scans of 16 um, origin lower left; sigma0 computed independently, README of the data
    camera = (shared_data / "rc30_pair/Lab5/rc30.cam").read_text().splitlines()
    start = next(k for k, line in enumerate(camera) if line.startswith("Fiducial x,y"))
    marks = np.array([line.split() for line in camera[start + 1 : start + 9]], dtype=float)
    pixels = np.loadtxt(shared_data / f"rc30_pair/Lab6/fiducialsImg{photo}.txt", skiprows=1)
    found = fit(pixels, marks)
    assert found.sigma0[0] == pytest.approx(sigma0_um, abs=0.05)


def test_film_deformation_is_recovered_exactly() -> None:
    # film deformation (docs/formulas.md 2.2): scales 1.0003 and 0.9998, shear of 20 seconds
    shear = np.deg2rad(20 / 3600)
    film = np.array([[1.0003, shear], [0.0, 0.9998]])
    measured = CORNERS @ film.T + [150.0, 140.0]
    found = fit(measured, CORNERS)
    assert found.matrix[0, :, :2] == pytest.approx(np.linalg.inv(film), abs=1e-12)
    assert transform(found.matrix, measured[None])[0] == pytest.approx(CORNERS, abs=1e-10)
    assert found.sigma0[0] < 1e-8


def test_covariance_of_a_symmetric_square_has_its_closed_form() -> None:
    # four marks at (+-a, +-a): var d0 = s^2/4, var d1 = s^2/(4 a^2), no correlation
    square = 100.0 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    covariance = fit(square, square, 0.005).covariance[0]
    wanted = 0.005**2 / 4 * np.array([1, 1e-4, 1e-4, 1, 1e-4, 1e-4])
    assert covariance == pytest.approx(np.diag(wanted), abs=1e-18)


def test_sigmas_follow_a_scan_turned_by_a_right_angle() -> None:
    turned = CORNERS @ np.array([[0.0, 1.0], [-1.0, 0.0]])  # u = -y, v = x
    sigma = np.broadcast_to([0.003, 0.001], (1, 4, 2))
    found = affine_from_fiducials(turned[None], CORNERS[None], sigma, np.ones((1, 4), bool))
    # y is measured along u: sigma 3 um, x along v: 1 um
    assert found.covariance[0, 0, 0] == pytest.approx(0.001**2 / 4, rel=1e-4)
    assert found.covariance[0, 3, 3] == pytest.approx(0.003**2 / 4, rel=1e-4)


def test_images_with_different_numbers_of_marks_are_independent() -> None:
    rng = np.random.default_rng(3)
    eight = np.concatenate([CORNERS, SIDES])
    measured = eight + rng.normal(0, 0.005, (2, 8, 2))
    used = np.ones((2, 8), bool)
    used[0, 4:] = False
    measured[0, 4:] = np.nan
    both = affine_from_fiducials(measured, np.stack([eight, eight]), np.full((2, 8, 2), 0.005), used)
    assert both.redundancy.tolist() == [2, 10]
    assert both.matrix[0] == pytest.approx(fit(measured[0, :4], CORNERS).matrix[0], abs=1e-12)
    assert both.matrix[1] == pytest.approx(fit(measured[1], eight).matrix[0], abs=1e-12)


def test_three_marks_leave_sigma0_open_and_two_or_collinear_ones_everything() -> None:
    three = fit(CORNERS[:3] + np.array([0.004, 0.0]), CORNERS[:3])
    assert three.determined[0]
    assert three.redundancy[0] == 0
    assert np.isnan(three.sigma0[0])
    line = np.array([[-100.0, 0.0], [0.0, 0.01], [100.0, 0.0]])
    for marks in (CORNERS[:2], line):
        found = fit(marks, marks)
        assert not found.determined[0]
        assert np.isnan(found.matrix).all()


def test_a_blunder_among_four_marks_cannot_be_located() -> None:
    measured = CORNERS.copy()
    measured[1] += [0.2, 0.1]
    found = fit(measured, CORNERS, 0.005, snooped=True)
    assert found.used.all()
    assert found.test[0] == pytest.approx(np.full(4, found.test[0, 0]), rel=1e-3)
    assert found.sigma0[0] > 4


def test_a_blunder_among_eight_marks_is_rejected_with_its_size() -> None:
    rng = np.random.default_rng(1)
    eight = np.concatenate([CORNERS, SIDES])
    measured = eight + rng.normal(0, 0.003, eight.shape)
    measured[5] += [0.10, -0.05]
    found = fit(measured, eight, 0.003, snooped=True)
    assert np.flatnonzero(~found.used[0]).tolist() == [5]
    assert found.residual_mm[0, 5] == pytest.approx([0.10, -0.05], abs=0.015)
    assert found.sigma0[0] < 2


def test_opposite_corners_of_five_marks_cannot_be_told_apart() -> None:
    five = np.concatenate([100.0 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]), [[0.0, 0.0]]])
    assert abs(residual_correlation(five)[0, 2]) == pytest.approx(1.0, abs=1e-9)
    measured = five.copy()
    measured[0, 0] += 0.1
    assert fit(measured, five, 0.003, snooped=True).used.all()
    measured = five.copy()
    measured[4, 0] += 0.1  # the centre can be told from all corners
    assert np.flatnonzero(~fit(measured, five, 0.003, snooped=True).used[0]).tolist() == [4]
