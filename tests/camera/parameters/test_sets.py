"""Parameter sets: published formulas, orthogonality, rank with the exterior orientation, conversion, user's own."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from aatri.camera.models.brown import brown_correction
from aatri.camera.parameters.brown import BROWN21, BROWN_CONRADY, interior_orientation
from aatri.camera.parameters.catalogue import SETS, parameter_set
from aatri.camera.parameters.ebner import EBNER12, bauer3
from aatri.camera.parameters.error_field import image_error_field
from aatri.camera.parameters.exterior_effects import (
    EXTERIOR,
    exterior_effects,
    format_grid,
)
from aatri.camera.parameters.parameter_set import (
    chosen,
    correction,
    scale_of_format,
)
from aatri.errors import SpecError
from tests.camera.parameters.spans import outside_span, vanishing, vanishing_with_exterior

FILM = scale_of_format((115.0, 115.0), 153.84, base_mm=90.0)
DIGITAL = scale_of_format((52.0, 34.0), 100.5)
POINTS = np.random.default_rng(1).uniform(-110, 110, (40, 2))


def _grid(n: int) -> Any:
    t = np.linspace(-FILM.base_mm, FILM.base_mm, n)
    return np.stack([np.tile(t, n), np.repeat(t, n)], axis=1)


def _flat(columns: Any) -> Any:
    return columns.reshape(-1, columns.shape[2])


def _correlation(a: Any, b: Any) -> float:
    a, b = a.ravel(), b.ravel()
    return float(a @ b / np.sqrt((a @ a) * (b @ b)))


@pytest.mark.parametrize("name", SETS)
@pytest.mark.parametrize("scale", [FILM, DIGITAL], ids=["film", "digital"])
def test_terms_are_of_comparable_size_and_independent(name: str, scale: Any) -> None:
    columns = parameter_set(name).basis(format_grid(scale), scale)
    assert columns.shape == (225, 2, len(parameter_set(name)))
    largest = np.abs(columns).max(axis=(0, 1))
    assert largest.min() > 0.1
    assert largest.max() < 9.1  # p4(1)^2 = 9 of the orthonormal Legendre polynomials
    assert np.linalg.matrix_rank(_flat(columns)) == len(parameter_set(name))


@pytest.mark.parametrize("name", SETS)
def test_the_correction_is_linear_in_its_parameters(name: str) -> None:
    # the derivative by complex step of a linear function is its basis
    s = parameter_set(name)
    K = s.basis(POINTS, FILM)
    for k in range(len(s)):
        values = np.zeros(len(s), complex)
        values[k] = 1e-200j
        found = correction(s, FILM, values, POINTS).imag / 1e-200
        assert np.abs(found - K[:, :, k]).max() <= 1e-15 * np.abs(K[:, :, k]).max()


def test_sizes() -> None:
    wanted = {"brown_conrady": 10, "brown21": 21, "ebner12": 12, "gruen44": 44, "bauer3": 3, "fourier": 16}
    assert {name: len(parameter_set(name)) for name in wanted} == wanted
    assert [len(parameter_set("legendre", orders=(n, n))) for n in (2, 4, 5)] == [12, 44, 66]
    assert len(parameter_set("fourier", orders=(2, 2))) == 48


def test_brown_conrady_in_classical_values_is_the_model_of_the_cameras() -> None:
    rng = np.random.default_rng(2)
    p = rng.normal(size=10) * 0.02
    values = BROWN_CONRADY.classical_factors(FILM) * p
    lens = dict(zip(BROWN_CONRADY.parameters[3:], values[3:]))
    wanted = brown_correction(POINTS, lens) - POINTS * p[0] / 153.84 - p[1:3]
    assert np.abs(correction(BROWN_CONRADY, FILM, p, POINTS) - wanted).max() < 1e-15


def test_aicon_by_hand() -> None:
    # x = 12, y = -9 (r = 15), c0 = 24, half diagonal 21.63, r0 two thirds of it: the image error of the textbook
    scale = scale_of_format((18.0, 12.0), 24.0)
    s = parameter_set("aicon")
    v = np.array([0.3, 0.02, -0.03, -1e-4, 2e-7, -3e-10, 1e-5, -2e-5, 3e-4, -4e-4])
    x, y, r0 = 12.0, -9.0, 2 / 3 * np.hypot(18.0, 12.0)
    radial = v[3] * (225 - r0**2) + v[4] * (225**2 - r0**4) + v[5] * (225**3 - r0**6)
    ex = x * 0.3 / 24 + 0.02 + x * radial + v[6] * (225 + 2 * 144) + 2 * v[7] * x * y + v[8] * x + v[9] * y
    ey = y * 0.3 / 24 - 0.03 + y * radial + v[7] * (225 + 2 * 81) + 2 * v[6] * x * y
    in_mm = v / s.classical_factors(scale)
    found = correction(s, scale, in_mm, np.array([[x + ex, y + ey]]))  # measured: the projection with its error
    np.testing.assert_allclose(found, [[-ex, -ey]], rtol=1e-11)


def test_the_radius_of_balanced_sets_is_an_option_and_part_of_their_name() -> None:
    at_r0 = np.array([[6.0, -8.0]])
    for name in ("aicon", "bauer3"):
        chosen = parameter_set(name, balance_radius_mm=10.0)
        radial = chosen.parameters.index("A1" if name == "aicon" else "a1")
        assert np.abs(chosen.basis(at_r0, FILM)[0, :, radial]).max() < 1e-15
        again = parameter_set(chosen.name)
        np.testing.assert_array_equal(again.basis(POINTS, FILM), chosen.basis(POINTS, FILM))
    with pytest.raises(SpecError, match="no balance radius"):
        parameter_set("brown21", balance_radius_mm=10.0)


@pytest.mark.parametrize(("name", "count"), [("fourier", 48), ("legendre", 12)])
def test_orders_are_an_option_and_part_of_the_name(name: str, count: int) -> None:
    chosen = parameter_set(name, orders=(2, 2))
    again = parameter_set(chosen.name)
    assert (len(again), chosen.name) == (count, f"{name} 2x2")
    np.testing.assert_array_equal(again.basis(POINTS, FILM), chosen.basis(POINTS, FILM))


def test_aicon_spans_what_brown_conrady_spans_and_separates_c_from_the_first_radial_term() -> None:
    grid = format_grid(DIGITAL)
    balanced, brown = (_flat(parameter_set(n).basis(grid, DIGITAL)) for n in ("aicon", "brown_conrady"))
    assert np.linalg.matrix_rank(np.hstack([balanced, brown]), tol=1e-9) == 10
    assert abs(_correlation(balanced[:, 0], balanced[:, 3])) < 0.5 * abs(_correlation(brown[:, 0], brown[:, 3]))


def test_linear_interior_orientation_is_exact() -> None:
    # a camera with c, x0, y0: x = x0 - c u1/u3; the corrected coordinates are those of the nominal camera
    c0, c, x0, y0 = 153.84, 155.1, 0.4, -0.3
    t = POINTS / 150.0
    measured = c * t + [x0, y0]
    p = np.zeros(10)
    p[:3] = c0 * (1 - c0 / c), x0 * c0 / c, y0 * c0 / c
    assert np.abs(measured + correction(BROWN_CONRADY, FILM, p, measured) - c0 * t).max() < 1e-13
    found, derivative = interior_orientation(c0, p[:3])
    assert found == pytest.approx([c, x0, y0], rel=1e-14)
    for k in range(3):
        step = p[:3].astype(complex)
        step[k] += 1e-200j
        wanted = interior_orientation(c0, step)[0].imag / 1e-200
        assert derivative[:, k] == pytest.approx(wanted, rel=1e-13, abs=1e-16)


def test_brown21_by_hand() -> None:
    # x = 30, y = -20, f = 150 of the notes' formula, every classical coefficient 10^-(degree)
    scale = scale_of_format((115.0, 115.0), 150.0)
    a = np.array([1e-3, 2e-3, 3e-5, 4e-5, 5e-7, 6e-7, 7e-9, 8e-5, 9e-5, 1e-7, 2e-7, 3e-9,
                  4e-5, 5e-9, 6e-9, 7e-8, 8e-12, 9e-16, 0.01, 0.02, 0.03])  # fmt: skip
    x, y, f = 30.0, -20.0, 150.0
    r2 = 1300.0
    plate = a[12] * (900 - 400) + a[13] * 360000 + a[14] * (810000 - 160000)
    radial = a[15] * r2 + a[16] * r2**2 + a[17] * r2**3
    dx = a[0] * x + a[1] * y + a[2] * -600 + a[3] * 400 + a[4] * -18000 + a[5] * 12000 + a[6] * 360000
    dy = a[7] * -600 + a[8] * 900 + a[9] * -18000 + a[10] * 12000 + a[11] * 360000
    dx += x / f * plate + x * radial + a[18] + a[20] * x / f
    dy += y / f * plate + y * radial + a[19] + a[20] * y / f
    found = correction(BROWN21, scale, a / BROWN21.classical_factors(scale), np.array([[x, y]]))
    assert found[0] == pytest.approx([dx, dy], rel=1e-14)


def test_brown21_loses_the_orientation_of_the_camera_on_flat_terrain() -> None:
    # 27 columns of rank 24: a19, a20, a21 are X0, Y0, Z0
    xy = format_grid(FILM)
    columns = [BROWN21.basis(xy, FILM), exterior_effects(xy, FILM.principal_distance_mm)]
    singular = np.linalg.svd(_unit(np.concatenate(columns, axis=2)), compute_uv=False)
    assert (singular > 1e-10).sum() == 24
    assert vanishing_with_exterior(BROWN21, FILM) == {
        frozenset(pair) for pair in (("a19", "X0"), ("a20", "Y0"), ("a21", "Z0"))
    }


@pytest.mark.parametrize("name", ["ebner12", "gruen44", "bauer3", "fourier", "legendre"])
def test_other_sets_are_free_of_the_orientation(name: str) -> None:
    assert vanishing_with_exterior(parameter_set(name), FILM) == set()


def test_sets_together_are_told_what_they_share() -> None:
    # Brown-Conrady's b1, b2 and k1 are combinations of Brown 21's
    xy = format_grid(FILM)
    columns = [chosen(BROWN_CONRADY, ["k1", "b1"]).basis(xy, FILM), BROWN21.basis(xy, FILM)]
    lost = vanishing(np.concatenate(columns, axis=2), ("k1", "b1", *BROWN21.parameters))
    assert lost == {frozenset(("k1", "a16")), frozenset(("b1", "a1"))}


def _unit(columns: Any) -> Any:
    flat = _flat(columns)
    return flat / np.linalg.norm(flat, axis=0)


def test_bauer_is_free_of_rotation_and_scale_and_the_misprint_is_not() -> None:
    scale = scale_of_format((115.0, 115.0), 153.84)
    t, w = np.polynomial.legendre.leggauss(5)  # exact integrals over the format, not sums over a grid
    xy = 115.0 * np.stack([np.tile(t, 5), np.repeat(t, 5)], axis=1)
    weight = np.sqrt(np.outer(w, w).ravel())[:, None]
    K = weight[:, :, None] * bauer3().basis(xy, scale)
    Z0, kappa = (weight * exterior_effects(xy, 153.84)[:, :, EXTERIOR.index(name)] for name in ("Z0", "kappa"))
    for other in (Z0, kappa, K[:, :, 0]):
        assert abs(_correlation(K[:, :, 2], other)) < 1e-15
    assert abs(_correlation(K[:, :, 0], Z0)) < 1e-15
    misprint = weight * np.stack([-xy[:, 1], xy[:, 1]], axis=1)
    assert _correlation(misprint, kappa) == pytest.approx(-0.5)
    assert _correlation(misprint, Z0) == pytest.approx(0.5)


def test_bauer_with_the_radius_of_the_notes() -> None:
    # a1 = 1e-8 mm^-2 at (60, 0): x (r^2 - 100^2) a1 = 60 (3600 - 10000) 1e-8
    s = bauer3(100.0)
    values = np.array([1e-8, 0.0, 0.0]) / s.classical_factors(FILM)
    assert correction(s, FILM, values, np.array([[60.0, 0.0]]))[0] == pytest.approx([-3.84e-3, 0.0], abs=1e-18)


def test_fourier_terms_are_orthogonal_over_the_format() -> None:
    n = 16
    t = (np.arange(n) + 0.5) / n * 2 - 1
    xy = np.stack([np.tile(t, n), np.repeat(t, n)], axis=1) * DIGITAL.half_format_mm
    K = _flat(parameter_set("fourier", orders=(2, 3)).basis(xy, DIGITAL))
    assert np.abs(K.T @ K / (n * n / 2) - np.eye(K.shape[1])).max() < 1e-13


def test_rotational_symmetry() -> None:
    # a quarter turn of the image turns the radial corrections with it and swaps the affine ones' sign
    turn = np.array([[0.0, -1.0], [1.0, 0.0]])
    K, turned = BROWN_CONRADY.basis(POINTS, FILM), BROWN_CONRADY.basis(POINTS @ turn.T, FILM)
    for name in ("c", "k1", "k2", "k3"):
        k = BROWN_CONRADY.parameters.index(name)
        assert np.abs(turned[:, :, k] - K[:, :, k] @ turn.T).max() < 1e-15
    B, turned_B = EBNER12.basis(POINTS, FILM), EBNER12.basis(POINTS @ turn.T, FILM)
    assert np.abs(turned_B[:, :, 0] + B[:, :, 0] @ turn.T).max() < 1e-15


def test_classical_radial_terms_are_those_at_the_corner_by_its_powers() -> None:
    r0 = np.hypot(115, 115)
    assert BROWN_CONRADY.classical_factors(FILM)[3:5] == pytest.approx([1.0 / r0**3, 1.0 / r0**5])


def test_a_choice_of_parameters_keeps_the_order_of_the_set() -> None:
    s = chosen(BROWN_CONRADY, ["k2", "c"])
    assert s.parameters == ("c", "k2")
    assert s.units == ("mm", "mm^-4")
    assert np.array_equal(s.basis(POINTS, FILM), BROWN_CONRADY.basis(POINTS, FILM)[:, :, [0, 4]])
    with pytest.raises(SpecError, match="no parameter 'k9'"):
        chosen(BROWN_CONRADY, ["k9"])


def test_image_error_field() -> None:
    p, covariance = np.zeros(10), np.zeros((10, 10))
    p[[0, 3]] = 0.3, 0.01
    covariance[3, 3] = 0.002**2
    field = image_error_field(BROWN_CONRADY, FILM, p, covariance, n=3)
    # corner: c makes +x dc/c0, k1 -x/r0 k1; sigma x/r0 sigma_k1
    assert field.error_mm[-1] == pytest.approx([115 * 0.3 / 153.84 - 0.01 / np.sqrt(2)] * 2)
    assert field.sigma_mm[-1] == pytest.approx([0.002 / np.sqrt(2)] * 2)
    alone = image_error_field(chosen(BROWN_CONRADY, ["c"]), FILM, np.array([0.3]), np.zeros((1, 1)))
    assert np.abs(alone.shape_mm).max() < 1e-13
    assert np.linalg.norm(alone.error_mm, axis=1).max() == pytest.approx(np.hypot(115, 115) * 0.3 / 153.84)


def test_what_a_set_cannot_describe_stays() -> None:
    # x^3 + x y^2 in dx: Ebner has x y^2 but no x^3; what stays is x^3 less its fit by x, 2/5 h^3 (t^3 - 3 t/5) rms
    t = (np.arange(50) + 0.5) / 25 - 1
    xy = np.stack([np.tile(t, 50), np.repeat(t, 50)], axis=1)
    k1 = xy * (xy**2).sum(axis=1)[:, None]
    scale = scale_of_format((1.0, 1.0), 1.5)
    rest = outside_span(EBNER12, scale, xy, k1)
    assert np.sqrt((rest**2).mean()) == pytest.approx(np.sqrt(1 / 7 - 3 / 25), rel=2e-2)
    for name in ("brown_conrady", "brown21", "gruen44", "legendre"):
        assert np.abs(outside_span(parameter_set(name), scale, xy, k1)).max() < 1e-11


def test_unknown_sets_and_orders_are_refused() -> None:
    with pytest.raises(SpecError, match="did you mean 'ebner12'"):
        parameter_set("ebner")
    with pytest.raises(SpecError, match="ebner12 has no orders"):
        parameter_set("ebner12", orders=(2, 2))
    with pytest.raises(SpecError, match="order 0"):
        parameter_set("fourier", orders=(0, 1))
    with pytest.raises(SpecError, match="degree 1"):
        parameter_set("legendre", orders=(1, 4))
    with pytest.raises(SpecError, match="half format is nan"):
        scale_of_format((np.nan, 115.0), 153.84)
