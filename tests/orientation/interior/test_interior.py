"""Transformations onto fiducial marks: published examples, closed forms, gross errors."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from aatri.geometry.plane_transformations import PARAMETERS, open_basis, transform_plane
from aatri.orientation.interior.fiducial_fit import fit_fiducials, snooped_fiducials

CORNERS = np.array([[106.002, -106.003], [-106.001, -106.004], [-106.0, 106.002], [105.999, 106.002]])
SIDES = np.array([[112.001, 0.002], [-111.999, -0.001], [0.003, 112.002], [-0.002, -112.001]])


def fit(
    measured: np.ndarray, calibrated: np.ndarray, sigma_mm: float = 0.001, snooped: bool = False, model: str = "affine"
) -> Any:
    one = (measured[None], calibrated[None], np.full((1, *calibrated.shape), sigma_mm))
    method = snooped_fiducials if snooped else fit_fiducials
    return method(model, *one, np.ones((1, len(calibrated)), dtype=bool))


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
    assert transform_plane("affine", found.matrix, found.terms, measured[None])[0] == pytest.approx(CORNERS, abs=1e-10)
    assert found.sigma0[0] < 1e-8


def test_covariance_of_a_symmetric_square_has_its_closed_form() -> None:
    # four marks at (+-a, +-a): var d0 = s^2/4, var d1 = s^2/(4 a^2), no correlation
    square = 100.0 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    covariance = fit(square, square, 0.005).covariance[0]
    wanted = 0.005**2 / 4 * np.array([1, 1e-4, 1e-4, 1, 1e-4, 1e-4, 0, 0])
    assert covariance == pytest.approx(np.diag(wanted), abs=1e-18)


def test_sigmas_follow_a_scan_turned_by_a_right_angle() -> None:
    turned = CORNERS @ np.array([[0.0, 1.0], [-1.0, 0.0]])  # u = -y, v = x
    sigma = np.broadcast_to([0.003, 0.001], (1, 4, 2))
    found = fit_fiducials("affine", turned[None], CORNERS[None], sigma, np.ones((1, 4), bool))
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
    both = fit_fiducials("affine", measured, np.stack([eight, eight]), np.full((2, 8, 2), 0.005), used)
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
    assert fit(five + 0.01 * np.sin(np.arange(10.0)).reshape(5, 2), five).separable[0].tolist() == [False] * 4 + [True]
    measured = five.copy()
    measured[0, 0] += 0.1
    assert fit(measured, five, 0.003, snooped=True).used.all()
    measured = five.copy()
    measured[4, 0] += 0.1  # the centre can be told from all corners
    assert np.flatnonzero(~fit(measured, five, 0.003, snooped=True).used[0]).tolist() == [4]


def turned(points: np.ndarray, degrees: float) -> np.ndarray:
    a = np.deg2rad(degrees)
    return points @ np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]])


def deformed(model: str, photo: np.ndarray) -> np.ndarray:
    """Measured coordinates whose transformation of this model, with numbers made up here, gives the photo."""
    a, b = 0.99 * np.cos(0.3), 0.99 * np.sin(0.3)
    linear = np.array([[a, -b], [b, a]]) @ (
        np.eye(2) if model == "similarity" else np.array([[1.001, 4e-4], [0, 0.999]])
    )
    uv = photo.copy()
    for _ in range(50):
        product = (uv[:, 0] * uv[:, 1])[:, None] * np.array([3e-7, -2e-7])
        w = 1 + uv @ np.array([4e-6, -5e-6])
        wanted = {"bilinear": photo - product, "projective": photo * w[:, None]}.get(model, photo)
        uv = np.linalg.solve(linear, (wanted - [3.0, -2.0]).T).T
    return uv


EIGHT = np.concatenate([CORNERS, SIDES])
MODELS = sorted(PARAMETERS)


@pytest.mark.parametrize("model", MODELS)
def test_every_transformation_comes_back_exactly(model: str) -> None:
    grid = np.stack(np.meshgrid(np.linspace(-110, 110, 7), np.linspace(-110, 110, 7)), axis=-1).reshape(-1, 2)
    found = fit(deformed(model, EIGHT), EIGHT, model=model)
    assert found.redundancy[0] == 16 - PARAMETERS[model]
    back = transform_plane(model, found.matrix, found.terms, deformed(model, grid)[None])[0]
    assert back == pytest.approx(grid, abs=1e-9)
    assert found.sigma0[0] < 1e-7


@pytest.mark.parametrize("model", MODELS)
def test_pixels_with_y_down_give_what_millimetres_give(model: str) -> None:
    rng = np.random.default_rng(8)
    mm = deformed(model, EIGHT) + rng.normal(0, 0.003, EIGHT.shape)
    size = np.array([0.02, -0.02])
    pixel = mm / size + [5000.0, 7000.0]
    used, sigma = np.ones((1, 8), bool), np.full((1, 8, 2), 0.003)
    found = fit_fiducials(model, pixel[None], EIGHT[None], sigma, used, size[None])
    wanted = fit(mm, EIGHT, 0.003, model=model)
    assert found.residual_mm == pytest.approx(wanted.residual_mm, abs=1e-9)
    assert found.photo_from_nominal == pytest.approx(wanted.photo_from_nominal, abs=1e-11)
    assert found.covariance == pytest.approx(wanted.covariance, rel=1e-5, abs=1e-20)


@pytest.mark.slow
@pytest.mark.parametrize("model", MODELS)
def test_what_the_marks_leave_open_is_what_the_photo_coordinates_scatter_by(model: str) -> None:
    """Covariance of the corrections against photo coordinates of many noisy measurements of the same marks."""
    rng = np.random.default_rng(4)
    n, sigma = 4000, 0.005
    measured = deformed(model, EIGHT) + rng.normal(0, sigma, (n, 8, 2))
    many = fit_fiducials(model, measured, np.tile(EIGHT, (n, 1, 1)), np.full((n, 8, 2), sigma), np.ones((n, 8), bool))
    places = np.array([[0.0, 0.0], [80.0, 50.0], [-100.0, 100.0]])
    found = transform_plane(model, many.matrix, many.terms, np.tile(deformed(model, places), (n, 1, 1)))
    K = open_basis(model, places, np.tile(many.photo_from_nominal[0], (3, 1, 1)))
    expected = np.sqrt(np.einsum("nki,ij,nkj->nk", K, many.covariance[0], K))
    # the standard deviation of a standard deviation of n values is 1 / sqrt(2 n); 4.5 of them, and 1 % for the scale
    assert found.std(axis=0) / expected == pytest.approx(np.ones((3, 2)), abs=4.5 / np.sqrt(2 * n) + 0.01)
    assert (many.sigma0**2).mean() == pytest.approx(1.0, abs=4.5 * np.sqrt(2 / n / many.redundancy[0]))


def test_one_wrong_mark_of_four_is_found_by_a_similarity() -> None:
    rng = np.random.default_rng(6)
    measured = turned(CORNERS, 20.0) + rng.normal(0, 0.003, CORNERS.shape)
    measured[2] += [0.05, 0.04]
    found = fit(measured, CORNERS, 0.003, snooped=True, model="similarity")
    assert np.flatnonzero(~found.used[0]).tolist() == [2]


def test_a_reseau_of_sixteen_marks(example: Any) -> None:
    """Against numpy's least squares, and a projective transformation by its homogeneous equations."""
    given = example("reseau_16pt_lecture")
    uv, xy = np.array(given["comparator"]), np.array(given["reseau"], dtype=float)
    u, v = (uv - uv.mean(axis=0)).T
    one, zero = np.ones(16), np.zeros(16)
    design = {
        "similarity": (np.stack([one, zero, u, -v], 1), np.stack([zero, one, v, u], 1)),
        "affine": (np.stack([one, u, v], 1),) * 2,
        "bilinear": (np.stack([one, u, v, u * v], 1),) * 2,
    }
    for model, (of_x, of_y) in design.items():
        if model == "similarity":
            A, b = np.concatenate([of_x, of_y]), np.concatenate(xy.T)
            wanted = (A @ np.linalg.lstsq(A, b)[0] - b).reshape(2, 16).T
        else:
            wanted = of_x @ np.linalg.lstsq(of_x, xy)[0] - xy
        assert fit(uv, xy, model=model).residual_mm[0] == pytest.approx(wanted, abs=1e-9)
    projective, affine = fit(uv, xy, model="projective"), fit(uv, xy)
    assert (projective.residual_mm**2).sum() < (affine.residual_mm**2).sum()
    # the sum of squares is least: any small change of the 8 parameters makes it larger
    for k in range(8):
        for sign in (-1, 1):
            changed = projective.matrix[0].copy(), projective.terms[0].copy()
            if k < 6:
                changed[0].flat[k] += sign * 1e-5
            else:
                changed[1][k - 6] += sign * 1e-7
            assert ((transform_plane("projective", *changed, uv) - xy) ** 2).sum() > (projective.residual_mm**2).sum()


@pytest.mark.parametrize("model", ["bilinear", "projective"])
def test_four_marks_on_the_axes_or_three_on_a_line_do_not_determine_eight_parameters(model: str) -> None:
    wrong = SIDES if model == "bilinear" else np.array([[-100.0, 0], [0, 0], [100, 0], [0, 100]])
    assert not fit(wrong, wrong, model=model).determined[0]
    assert fit(CORNERS, CORNERS, model=model).determined[0]
    assert not fit(CORNERS[:3], CORNERS[:3], model=model).determined[0]
