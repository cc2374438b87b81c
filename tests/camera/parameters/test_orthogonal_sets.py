"""Orthogonal polynomials as additional parameters: Ebner, Gruen, Legendre."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from aatri.camera.parameters.catalogue import parameter_set
from aatri.camera.parameters.ebner import EBNER12
from aatri.camera.parameters.exterior_effects import (
    exterior_effects,
    format_grid,
    share_in_span,
)
from aatri.camera.parameters.orthogonal import GRUEN44
from tests.camera.parameters.test_sets import DIGITAL, FILM, _flat, _grid


def test_ebner_by_hand() -> None:
    # b = 90, point (b, -b): u = v = b^2/3
    found = EBNER12.basis(np.array([[90.0, -90.0]]), FILM)[0] * EBNER12.classical_factors(FILM) ** -1
    b, u = 90.0, 2700.0
    wanted_x = [b, -b, -2 * u, -b * b, u, 0, b * u, 0, -b * u, 0, u * u, 0]
    wanted_y = [b, b, -b * b, -2 * u, 0, u, 0, -b * u, 0, b * u, 0, u * u]
    assert found[0] == pytest.approx(wanted_x, rel=1e-14)
    assert found[1] == pytest.approx(wanted_y, rel=1e-14)


def test_ebner_is_orthogonal_on_the_gruber_positions_and_complete_with_the_orientation() -> None:
    K = _flat(EBNER12.basis(_grid(3), FILM))
    K = K / np.linalg.norm(K, axis=0)
    E = _flat(exterior_effects(_grid(3), FILM.principal_distance_mm))
    assert np.abs(K.T @ K - np.eye(12)).max() < 1e-15
    assert np.abs(K.T @ (E / np.linalg.norm(E, axis=0))).max() < 1e-15
    assert np.linalg.matrix_rank(np.hstack([K, E])) == 18


@pytest.mark.parametrize("scale", [FILM, DIGITAL], ids=["film", "digital"])
def test_gruen_is_orthonormal_on_its_grid_and_complete_with_the_orientation(scale: Any) -> None:
    grid = _grid(5) / FILM.base_mm * scale.half_format_mm
    K = _flat(GRUEN44.basis(grid, scale))
    E = _flat(exterior_effects(grid, scale.principal_distance_mm))
    assert np.abs(K.T @ K / 25 - np.eye(44)).max() < 1e-14
    assert np.abs(K.T @ (E / np.linalg.norm(E, axis=0))).max() < 5e-14
    assert np.linalg.matrix_rank(np.hstack([K, E])) == 50


@pytest.mark.parametrize("scale", [FILM, DIGITAL], ids=["film", "digital"])
def test_legendre_is_orthonormal_over_the_format_and_free_of_the_orientation(scale: Any) -> None:
    t, w = np.polynomial.legendre.leggauss(9)
    xy = np.stack([np.tile(t, 9), np.repeat(t, 9)], axis=1) * scale.half_format_mm
    weight = np.sqrt(np.outer(w, w).ravel() / 4)[:, None, None]
    K = _flat(weight * parameter_set("legendre", orders=(4, 4)).basis(xy, scale))
    E = _flat(weight * exterior_effects(xy, scale.principal_distance_mm))
    assert np.abs(K.T @ K - np.eye(44)).max() < 1e-14
    assert np.abs(K.T @ E).max() < 1e-12 * scale.radius_mm


def test_names_of_terms_tell_their_degrees_apart_from_the_tenth_on() -> None:
    assert {"x31", "y24"} <= set(parameter_set("legendre", orders=(9, 9)).parameters)
    assert {"x3_1", "x2_10", "y10_0"} <= set(parameter_set("legendre", orders=(10, 10)).parameters)


def test_ebner_and_gruen_span_what_legendre_spans() -> None:
    # Tang et al.: the Legendre sets generalise Ebner's and Gruen's; equal up to the exterior orientation
    xy = format_grid(FILM)
    E = exterior_effects(xy, FILM.principal_distance_mm)
    for one, degree in ((EBNER12, 2), (GRUEN44, 4)):
        other = parameter_set("legendre", orders=(degree, degree)).basis(xy, FILM)
        share = share_in_span(one.basis(xy, FILM), np.concatenate([other, E], axis=2))
        assert np.abs(share - 1).max() < 1e-12
