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
