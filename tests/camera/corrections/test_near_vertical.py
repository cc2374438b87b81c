"""Refraction and earth curvature: the anchor numbers of the formula sheet, exact geometry, derivatives."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.camera.corrections.atmosphere import refraction_constant
from aatri.camera.corrections.vertical_planes import earth_curvature_correction, refraction_correction

C = np.array([152.0])
AT_100_MM = np.array([[60.0, 80.0]])


# docs/formulas.md 2.3: r = 100 mm, c = 152 mm
@pytest.mark.parametrize(
    ("station_m", "terrain_m", "inwards_um"), [(400, 20, 0.56), (1000, 0, 1.41), (4000, 0, 5.71), (9000, 0, 11.2)]
)
def test_refraction_anchors(station_m: float, terrain_m: float, inwards_um: float) -> None:
    K = np.atleast_1d(refraction_constant(station_m, terrain_m))
    correction = refraction_correction(AT_100_MM, K, C)
    assert 1e3 * np.linalg.norm(correction) == pytest.approx(inwards_um, abs=0.005 if inwards_um < 10 else 0.05)
    assert correction[0] @ AT_100_MM[0] < 0


# docs/formulas.md 2.4: r = 100 mm, c = 152 mm
@pytest.mark.parametrize(("height_m", "outwards_um"), [(380, 1.3), (4000, 13.6), (9000, 30.6)])
def test_earth_curvature_anchors(height_m: float, outwards_um: float) -> None:
    correction = earth_curvature_correction(AT_100_MM, np.array([height_m]), C)
    assert 1e3 * np.linalg.norm(correction) == pytest.approx(outwards_um, abs=0.05)
    assert correction[0] @ AT_100_MM[0] > 0


def test_earth_curvature_agrees_with_a_sphere() -> None:
    # a point of the sphere at the arc distance s from the nadir, seen from the height H, with the map distance s
    R, H, c, s = 6_371_000.0, 4000.0, 152.0, 2500.0
    below = R * (1 - np.cos(s / R))
    r = c * R * np.sin(s / R) / (H + below)
    corrected = r + earth_curvature_correction(np.array([[r, 0.0]]), np.array([H]), np.array([c]))[0, 0]
    # what is left is of higher order: less than 1 % of the correction
    assert abs(corrected - c * s / H) < 0.01 * (c * s / H - r)
