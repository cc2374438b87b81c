"""The standard atmosphere against its published tables, K against rays traced through thin layers, tilted images."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.camera.corrections.atmosphere import layered_constant, pressure_and_density, refraction_constant
from aatri.camera.corrections.vertical_planes import refraction_correction
from aatri.geometry.rotations import rotation_from_angles


# U.S. Standard Atmosphere 1976, table I: geometric height m, pressure Pa, density kg/m^3
@pytest.mark.parametrize(
    ("height_m", "pressure", "density"),
    [
        (-1000, 1.1393e5, 1.3470),
        (0, 1.01325e5, 1.2250),
        (1000, 8.9876e4, 1.1117),
        (5000, 5.4048e4, 0.73643),
        (11_000, 2.2699e4, 0.36480),
        (20_000, 5.5293e3, 0.088910),
        (30_000, 1.1970e3, 0.018410),
    ],
)
def test_the_atmosphere_is_that_of_the_tables(height_m: float, pressure: float, density: float) -> None:
    p, rho = pressure_and_density(height_m)
    assert p == pytest.approx(pressure, rel=1e-4)
    assert rho == pytest.approx(density, rel=1e-4)


def _traced(H_m: float, h_m: float, tan_theta: float) -> float:
    """Angle between a ray at the camera and the line to where it comes from, through 20,000 plane layers.

    Densities between the layers from the exponential gas law of each, step by step from the ground up, not in closed
    form; refractivity of air at 15 degrees and 1013.25 hPa 2.778e-4.
    """
    edges = np.linspace(h_m, H_m, 20_001)
    middle = 0.5 * (edges[1:] + edges[:-1])
    g0, M, Rs, r0 = 9.80665, 0.0289644, 8.31432, 6_356_766.0
    T = np.interp(r0 * middle / (r0 + middle), [0, 11_000, 20_000], [288.15, 216.65, 216.65])
    z = np.linspace(0.0, H_m, 200_001)  # pressures from sea level, by the trapezoidal rule of dp/p = -g M/(R T) dz
    g = g0 * (r0 / (r0 + z)) ** 2
    Tz = np.interp(r0 * z / (r0 + z), [0, 11_000, 20_000], [288.15, 216.65, 216.65])
    rate = g * M / (Rs * Tz)
    p = 101_325.0 * np.exp(-np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(z))]))
    n = 1.0 + 2.778e-4 / 1.2250 * np.interp(middle, z, p) * M / (Rs * T)
    n_H = 1.0 + 2.778e-4 / 1.2250 * p[-1] * M / (Rs * Tz[-1])
    sine = n_H * np.sin(np.arctan(tan_theta)) / n
    away = float((np.diff(edges) * sine / np.sqrt(1 - sine**2)).sum())
    return float(np.arctan(tan_theta) - np.arctan(away / (H_m - h_m)))


@pytest.mark.parametrize(("H_m", "h_m"), [(400, 20), (1000, 0), (4000, 500), (9000, 0), (14_000, 200)])
@pytest.mark.parametrize("tan_theta", [0.3, 1.0, 2.0])
def test_the_constant_is_the_angle_of_rays_traced_through_thin_layers(H_m: float, h_m: float, tan_theta: float) -> None:
    # K tan(theta) is the first order; gravity that decreases with height is in the traced ray only
    angle = float(layered_constant(H_m, h_m)) * tan_theta
    assert angle == pytest.approx(_traced(H_m, h_m, tan_theta), rel=3e-3)


def test_low_flights_are_refracted_by_a_quarter_more_than_the_coefficients_say() -> None:
    ratio = refraction_constant(800.0, 0.0) / layered_constant(800.0, 0.0)
    assert 0.74 < ratio < 0.82  # docs: some 22 % low
    assert layered_constant(500.0, 500.0) == pytest.approx(0.0, abs=1e-12)
    assert np.isnan(layered_constant(60_000.0, 0.0))


def test_vertical_images_are_corrected_along_the_radius() -> None:
    xy, c, K = np.array([[60.0, 80.0], [-30.0, 5.0]]), np.array([152.0, 152.0]), np.array([9e-5, 9e-5])
    turned = rotation_from_angles(np.array([[0.0, 0.0, 0.7], [0.0, 0.0, -2.0]]))
    found = refraction_correction(xy, K, c, turned)
    np.testing.assert_allclose(found, refraction_correction(xy, K, c), atol=1e-12)


def test_tilted_images_are_corrected_as_the_vertical_image_of_the_same_ray() -> None:
    """The corrected ray, turned into a vertical image at the same station, is the radially corrected one."""
    rng = np.random.default_rng(1)
    R = rotation_from_angles(rng.uniform(-0.7, 0.7, (20, 3)))
    xy, c, K = rng.uniform(-40, 40, (20, 2)), np.full(20, 100.0), np.full(20, 5e-5)

    def vertical(points: np.ndarray) -> np.ndarray:
        w = np.einsum("nij,nj->ni", R, np.concatenate([points, -c[:, None]], axis=1))
        return -c[:, None] * w[:, :2] / w[:, 2:]

    before = vertical(xy)
    after = vertical(xy + refraction_correction(xy, K, c, R))
    np.testing.assert_allclose(after - before, refraction_correction(before, K, c), atol=1e-11)


def test_rays_near_the_horizon_are_not_corrected() -> None:
    xy, c, K = np.array([[0.0, 0.0], [0.0, 99.0]]), np.array([10.0, 10.0]), np.array([5e-5, 5e-5])
    found = refraction_correction(xy, K, c, np.tile(np.eye(3), (2, 1, 1)))
    assert np.isfinite(found[0]).all()
    assert np.isnan(found[1]).all()
