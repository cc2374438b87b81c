"""Critical configurations are named."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from aatri.errors import GeometryError
from aatri.geometry.coplanarity import RayPairs
from aatri.orientation.relative.critical import GENERAL, critical_configuration, degenerate_pairs
from tests.complex_step import complex_step
from tests.orientation.relative.pairs import C_MM, gruber_ground, relative_orientation, simulate

ALONG = np.array([0.6, 0.0, 0.0])


def valley(n: int = 30) -> np.ndarray:
    """Points on a circular cylinder through both projection centres, along the base."""
    rng = np.random.default_rng(2)
    angle = rng.uniform(-0.9, 0.9, n)
    return np.column_stack([rng.uniform(0, 0.6, n), 0.5 * np.sin(angle), -0.5 - 0.5 * np.cos(angle)])


def said(X: np.ndarray, base: np.ndarray = ALONG, sigma: float = 0.005) -> str:
    rng = np.random.default_rng(1)
    rays, *_ = simulate(X, np.eye(3), np.eye(3), np.zeros(3), base, rng, sigma)
    try:
        return " ".join(relative_orientation(rays).warnings)
    except GeometryError as error:
        return f"{error.what} {error.remedy}"


def test_a_critical_cylinder_is_named() -> None:
    assert "critical cylinder" in said(valley())


def test_beside_the_critical_cylinder_the_standard_deviations_are_those_of_a_dense_pair() -> None:
    """Points 3 % of the height off the cylinder: rotation and base as two images with unknown points have them."""
    X = valley() + np.column_stack([np.zeros((30, 2)), np.random.default_rng(7).normal(0, 0.03, 30)])
    rays, R, base = simulate(X, np.eye(3), np.eye(3), np.zeros(3), ALONG)
    unit_points = X / np.linalg.norm(ALONG)
    across = np.linalg.svd(base[None])[2][1:]

    def image_points(z: Any) -> Any:
        w, points = z[:3], z[5:].reshape(-1, 3)
        turned = np.array([[1, -w[2], w[1]], [w[2], 1, -w[0]], [-w[1], w[0], 1]]) @ R
        second = (points - base - z[3:5] @ across) @ turned
        return np.concatenate([-C_MM * u[:, :2] / u[:, 2:] for u in (points, second)])

    J = complex_step(image_points, np.concatenate([np.zeros(5), unit_points.ravel()])) / 0.005
    dense = np.linalg.inv(J.T @ J)[:5, :5]
    ours = relative_orientation(rays).covariance
    assert np.sqrt(dense[0, 0]) > 3e-4  # of 5e-5 on flat ground
    np.testing.assert_allclose(ours[:3, :3], dense[:3, :3], rtol=1e-5, atol=1e-6 * dense[0, 0])
    np.testing.assert_allclose(np.trace(ours[3:, 3:]), np.trace(dense[3:, 3:]), rtol=1e-6)


def test_a_tiny_base_is_named() -> None:
    X = gruber_ground(5, np.random.default_rng(1), 0.05)
    assert "base" in said(X, np.array([0.004, 0.0, 0.0]))


def test_a_short_base_is_named_where_nothing_else_explains_the_weakness() -> None:
    rng = np.random.default_rng(6)
    rough = np.column_stack([rng.uniform(-10, 10, 40), rng.uniform(-10, 10, 40), -30 + rng.normal(0, 1.5, 40)])
    distance = np.median(np.linalg.norm(rough, axis=1))
    said_so = critical_configuration(rough, np.array([1.0, 0.0, 0.0]))
    assert said_so == f"the base is short, 1/{distance:.0f} of the distance to the points"


def test_collinear_points_are_named() -> None:
    rng = np.random.default_rng(3)
    X = np.column_stack([rng.uniform(0, 0.6, 20), np.zeros(20), -np.ones(20)])
    assert "line" in said(X)


@pytest.mark.parametrize(("off_sigmas", "on_a_line"), [(2.9, True), (3.1, False)])
def test_points_are_on_a_line_to_three_standard_deviations_root_mean_square(off_sigmas: float, on_a_line: bool) -> None:
    sigma = 0.005
    along, off = np.linspace(-60.0, 60.0, 12), off_sigmas * sigma * np.tile([1.0, -1.0, -1.0, 1.0], 3)
    left = np.column_stack([along, off, np.full(12, -C_MM)])  # the pattern of signs has no slope: the line is y = 0
    right = left - np.outer(40.0 + np.tile([9.0, -3.0, -6.0], 4), [1.0, 0.0, 0.0])
    right[:, 1] += np.tile([0.0, 20.0, -20.0], 4)
    sigmas = np.full((12, 2), sigma)
    reasons = degenerate_pairs(RayPairs(left, right, sigmas, sigmas), np.array([0, 12]), 6)
    assert reasons == ({0: "all points lie on a line in the left image"} if on_a_line else {})


def test_points_in_a_corner_are_named_so_and_not_a_cylinder() -> None:
    rng = np.random.default_rng(4)
    X = np.array([0.5, 0.6, -1.0]) + rng.uniform(-0.03, 0.03, (14, 3))
    assert "in a corner" in said(X)
    assert "cylinder" not in said(X)


def test_rough_ground_is_no_cylinder() -> None:
    rng = np.random.default_rng(5)
    rough = np.column_stack([rng.uniform(0, 1, 40), rng.uniform(-1, 1, 40), -2 + rng.normal(0, 0.06, 40)])
    assert critical_configuration(rough, np.array([1.0, 0.0, 0.0])) == GENERAL


def test_a_band_as_good_as_flat_is_a_plane_and_no_cylinder() -> None:
    """An arc of 0.14 rad on a circle of ten bases: its depth varies by 1.7 % of its width, well above FLAT bases."""
    rng = np.random.default_rng(2)
    angle = rng.uniform(-0.07, 0.07, 40)
    band = np.column_stack([rng.uniform(0, 1, 40), 10 * np.sin(angle), -10 - 10 * np.cos(angle)])
    assert critical_configuration(band, np.array([1.0, 0.0, 0.0])) == GENERAL


def test_fewer_than_five_points_are_named() -> None:
    assert "4" in said(gruber_ground(1)[:4])


def test_good_points_are_called_nothing() -> None:
    assert said(gruber_ground(5, np.random.default_rng(1), 0.05)) == ""


def test_configurations_of_model_points() -> None:
    base = np.array([1.0, 0.0, 0.0])
    assert "cylinder" in critical_configuration(valley() / 0.6, base)
    flat = gruber_ground(5, np.random.default_rng(1), 0.001) / 0.6
    assert critical_configuration(flat, base) == GENERAL
    assert "1/100 of the distance" in critical_configuration(np.array([[0.0, 0, -100]] * 6), base)
    assert critical_configuration(flat[:4], base) == GENERAL
