"""Fiducial marks numbered by their places, and the deformation of film."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.geometry.plane_transformations import open_basis
from aatri.orientation.interior.film_deformation import (
    prediction_sigma_mm,
    scales_and_shear,
    shear_or_stretch,
    turn_rad,
)
from aatri.orientation.interior.mark_tests import is_misfit, renumbering, scale_problem

# Exchanged numbers, mirrored marks and wrong scales are recognised.

CORNERS = np.array([[106.0, -106.0], [-106.0, -106.0], [-106.0, 106.0], [106.0, 106.0]])
EIGHT = np.concatenate([CORNERS, [[112.0, 0.0], [-112.0, 0.0], [0.0, 112.0], [0.0, -112.0]]])


def turned(points: np.ndarray, degrees: float) -> np.ndarray:
    a = np.deg2rad(degrees)
    return points @ np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]])


def test_exchanged_numbers_are_found() -> None:
    order = [1, 0, 2, 3, 4, 6, 5, 7]
    assert renumbering(turned(EIGHT[order], 1.0) + 50.0, EIGHT).tolist() == order


@pytest.mark.parametrize("quarter", [0, 90, 180, 270])
def test_a_scan_on_its_side_with_one_exchange_gives_a_numbering_that_fits(quarter: float) -> None:
    measured = turned(CORNERS[[1, 0, 2, 3]], quarter + 0.5)
    found = renumbering(measured, CORNERS)
    assert found is not None
    design = np.column_stack([measured, np.ones(4)])
    solution = np.linalg.lstsq(design, CORNERS[found], rcond=None)[0]
    assert np.abs(design @ solution - CORNERS[found]).max() < 1e-9
    assert np.linalg.det(solution[:2]) > 0


def test_a_mark_that_is_elsewhere_is_no_exchange() -> None:
    measured = CORNERS.copy()
    measured[2] = [0.0, 40.0]
    assert renumbering(measured, CORNERS) is None


@pytest.mark.parametrize(
    ("scale", "told"),
    [
        (1.0, ""),
        (1.019, ""),
        (25.4, "inches taken"),
        (1e-3, "micrometres taken"),
        (1000.0, "metres taken"),
        (0.96, "0.96"),
    ],
)
def test_scales(scale: float, told: str) -> None:
    found = scale_problem(scale * np.eye(2))
    assert told in found
    assert bool(found) == bool(told)


def test_misfits() -> None:
    assert is_misfit(np.array([[0.0, 5.0]] * 4), CORNERS)
    assert not is_misfit(np.array([[0.0, 0.5]] * 4), CORNERS)


def _rotation(angle: float) -> np.ndarray:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


@pytest.mark.parametrize("angle", [0.0, 0.01, 1.5, -3.0])
def test_a_turn_alone_deforms_nothing(angle: float) -> None:
    turned = _rotation(angle)[None]
    np.testing.assert_allclose(turn_rad(turned), angle, atol=1e-15)
    scale, shear = scales_and_shear(turned)
    np.testing.assert_allclose(scale, 1.0, atol=1e-15)
    np.testing.assert_allclose(shear, 0.0, atol=1e-15)
    np.testing.assert_allclose(shear_or_stretch(turned), 0.0, atol=1e-15)


@pytest.mark.parametrize("turn", [0.0, 0.4, 2.0])
def test_scales_and_shear_of_the_film_come_back(turn: float) -> None:
    # film = R (1.0003, tan(20") sy; 0, 0.9998) photo
    shear = np.deg2rad(20 / 3600)
    film = _rotation(turn) @ np.array([[1.0003, 0.9998 * np.tan(shear)], [0.0, 0.9998]])
    scale, found = scales_and_shear(np.linalg.inv(film)[None])
    np.testing.assert_allclose(scale[0], [1.0003, 0.9998], rtol=1e-12)
    np.testing.assert_allclose(found, shear, rtol=1e-9)


def test_the_largest_of_shear_and_stretch() -> None:
    A = _rotation(0.4) @ np.diag([1.0003, 0.9998])
    np.testing.assert_allclose(shear_or_stretch(A[None]), (1.0003**2 - 0.9998**2) / 2, rtol=1e-9)


def test_a_predicted_mark_has_the_errors_of_its_measurement_and_of_the_transformation() -> None:
    K = open_basis("affine", np.array([[50.0, 20.0]]), np.eye(2))
    sigma = prediction_sigma_mm(K, np.diag([4.0, 0, 0, 4.0, 0, 0, 0, 0])[None], np.array([[1.5, 1.5]]))
    np.testing.assert_allclose(sigma, 2.5)
