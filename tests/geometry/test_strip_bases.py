"""Deformations of strips."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.geometry.strip_bases import SECOND_DEGREE, strip_axes, strip_basis, terms
from tests.geometry.strip_deformation import correction_design

RNG = np.random.default_rng(5)
U, V = RNG.uniform(-1, 1, (2, 40))
RATIO = np.full(40, 0.3)


@pytest.mark.parametrize(
    ("form", "degree", "full", "size"),
    [
        ("polynomial", 0, False, 3),
        ("polynomial", 1, False, 9),
        ("polynomial", 2, False, 15),
        ("polynomial", 3, False, 21),
        ("polynomial", 2, True, 18),
        ("polynomial", 3, True, 30),
        ("conformal", 2, False, 11),
        ("conformal", 3, False, 15),
    ],
)
def test_numbers_of_coefficients(form: str, degree: int, full: bool, size: int) -> None:
    basis = strip_basis(form, degree, full=full)
    assert basis.size == size == len(set(basis.labels)) == len(basis.part) == len(basis.degree)
    assert basis.rows(U, V, RATIO).shape == (40, 3, size)
    assert int(basis.degree.max()) == degree


def test_the_second_degree_is_the_general_polynomial_of_five_coefficients() -> None:
    centres = np.column_stack([np.linspace(0, 2000, 9), np.zeros(9), np.full(9, 400.0)])
    points = RNG.uniform([0, -200, 0], [2000, 200, 20], (30, 3))
    axes = strip_axes(points, centres)
    local = ((points - axes.origin_m) @ axes.ground_from_axes)[:, :2] / axes.half_range_m
    rows = SECOND_DEGREE.rows(local[:, 0], local[:, 1], np.ones(30))
    np.testing.assert_allclose(axes.ground_from_axes @ rows, correction_design(axes, points), atol=1e-14)


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_the_conformal_form_satisfies_cauchy_riemann(degree: int) -> None:
    """Derivatives by complex step, in metres of one scale along and across."""
    basis, h, r = strip_basis("conformal", degree), 1e-30, 0.3
    by_u = basis.rows(U + 1j * h, V + 0j, RATIO).imag / h
    by_v = basis.rows(U + 0j, V + 1j * h, RATIO).imag / h / r
    np.testing.assert_allclose(by_u[:, 0], by_v[:, 1], atol=1e-13)
    np.testing.assert_allclose(by_v[:, 0], -by_u[:, 1], atol=1e-13)


def test_the_conformal_form_is_a_polynomial_of_complex_numbers() -> None:
    basis, c = strip_basis("conformal", 3), RNG.normal(size=8)
    z = U + 0.3j * V
    wanted = sum((c[2 * k] + 1j * c[2 * k + 1]) * z**k for k in range(4))
    found = basis.rows(U, V, RATIO)[:, :2, :8] @ c
    np.testing.assert_allclose(found[:, 0] + 1j * found[:, 1], wanted, atol=1e-13)


def test_the_narrow_form_is_that_of_the_lecture_notes() -> None:
    """dX = ... + A5 X^2 - 2 A6 X Y, dY = ... + A6 X^2 + 2 A5 X Y: without Y^2; equal to the exact one on the axis."""
    narrow, exact = strip_basis("conformal", 2, narrow=True), strip_basis("conformal", 2)
    y = 0.3 * V
    rows = narrow.rows(U, V, RATIO)
    np.testing.assert_allclose(rows[:, 0, 4:6], np.stack([U**2, -2 * U * y], axis=1), atol=1e-14)
    np.testing.assert_allclose(rows[:, 1, 4:6], np.stack([2 * U * y, U**2], axis=1), atol=1e-14)
    np.testing.assert_array_equal(narrow.rows(U, 0 * V, RATIO), exact.rows(U, 0 * V, RATIO))


@pytest.mark.parametrize(("degree", "count"), [(0, 1), (1, 3), (2, 5)])
def test_terms_of_each_degree(degree: int, count: int) -> None:
    u, v = np.array([0.5, -1.0]), np.array([2.0, 0.25])
    expected = np.array([[1, 0.5, 2.0, 0.25, 1.0], [1, -1.0, 0.25, 1.0, -0.25]])
    np.testing.assert_array_equal(terms(u, v, False, degree), expected[:, :count])


def test_u_runs_along_the_flight_and_both_lie_between_minus_one_and_one() -> None:
    azimuth = 2.5
    along, across = np.array([np.cos(azimuth), np.sin(azimuth)]), np.array([-np.sin(azimuth), np.cos(azimuth)])
    centres = np.column_stack([np.outer(np.arange(5) * 200.0, along) + 4.5e6, np.full(5, 400.0)])
    t, w = RNG.uniform(-100, 900, 50), RNG.uniform(-200, 200, 50)
    points = np.column_stack([np.outer(t, along) + np.outer(w, across) + 4.5e6, RNG.normal(0, 5, 50)])
    axes = strip_axes(points, centres)
    np.testing.assert_allclose(axes.ground_from_axes[:2, 0], along, atol=1e-9)
    local = (points - axes.origin_m) @ axes.ground_from_axes / [*axes.half_range_m, 1.0]
    np.testing.assert_allclose([local[:, 0].min(), local[:, 0].max(), local[:, 1].max()], [-1, 1, 1], atol=1e-9)


def test_a_correction_along_v_moves_the_point_across_the_strip() -> None:
    centres = np.array([[0.0, 0.0, 400.0], [0.0, 600.0, 400.0]])  # flown to the north: U = Y, V = -X
    points = np.column_stack([RNG.uniform(-200, 200, 9), RNG.uniform(0, 600, 9), np.zeros(9)])
    design = correction_design(strip_axes(points, centres), points)
    constant_b = design[:, :, 5]
    np.testing.assert_allclose(constant_b, np.tile([-1.0, 0.0, 0.0], (9, 1)), atol=1e-12)
