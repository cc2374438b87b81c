from __future__ import annotations

import numpy as np
import pytest

from aatri.orientation.interior.film_deformation import deformation, prediction_sigma_mm, shear_or_stretch, turn_rad


def _rotation(angle: float) -> np.ndarray:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


@pytest.mark.parametrize("angle", [0.0, 0.01, 1.5, -3.0])
def test_a_turn_alone_deforms_nothing(angle: float) -> None:
    turned = _rotation(angle)[None]
    np.testing.assert_allclose(turn_rad(turned), angle, atol=1e-15)
    np.testing.assert_allclose(deformation(turned), 0.0, atol=1e-15)
    np.testing.assert_allclose(shear_or_stretch(turned), 0.0, atol=1e-15)


def test_the_deformation_is_photo_minus_turned_nominal() -> None:
    stretch = np.diag([1.0003, 0.9998])
    A = _rotation(0.4) @ stretch
    nominal = np.array([106.0, -70.0])
    np.testing.assert_allclose(
        deformation(A[None])[0] @ (A @ nominal), A @ nominal - _rotation(0.4) @ nominal, atol=1e-12
    )
    np.testing.assert_allclose(shear_or_stretch(A[None]), (1.0003**2 - 0.9998**2) / 2, rtol=1e-9)


def test_a_predicted_mark_has_the_errors_of_its_measurement_and_of_the_transformation() -> None:
    sigma = prediction_sigma_mm(np.diag([4.0, 0, 0, 4.0, 0, 0])[None], np.array([[50.0, 20.0]]), np.array([[1.5, 1.5]]))
    np.testing.assert_allclose(sigma, 2.5)
