"""Forward intersection: the special frame of the notes, both sides, derivatives, accuracy by simulation, bars."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.orientation.network.forward_intersection import (
    derivatives,
    forward_intersection,
    intersect,
    plan_accuracy,
    scale_of_bar,
    with_control_error,
)
from tests.complex_step import complex_step

A, B = np.array([10.0, 20.0, 1.6]), np.array([16.0, 21.0, 1.4])


def _observed(P: np.ndarray, target_m: float = 0.0) -> np.ndarray:
    """Angles at A and B, vertical angles, from the cosine law and the arcs: no formula of the intersection."""
    a, b = P[:2] - A[:2], P[:2] - B[:2]
    base = B[:2] - A[:2]
    alpha = np.arccos(a @ base / np.linalg.norm(a) / np.linalg.norm(base))
    beta = np.arccos(-b @ base / np.linalg.norm(b) / np.linalg.norm(base))
    rise = [np.arctan2(P[2] + target_m - S[2], np.linalg.norm(P[:2] - S[:2])) for S in (A, B)]
    return np.array([alpha, beta, *rise])


@pytest.mark.parametrize("P", [[12.0, 29.0, 3.0], [15.0, 12.0, 0.2], [9.0, 24.0, 5.0]])
@pytest.mark.parametrize("target_m", [0.0, 0.25])
def test_a_point_is_found_from_its_angles_on_either_side(P: list[float], target_m: float) -> None:
    point = np.array(P)
    base = B - A
    left = base[0] * (point - A)[1] - base[1] * (point - A)[0] > 0
    np.testing.assert_allclose(intersect(A, B, _observed(point, target_m), target_m, bool(left)), point, atol=1e-12)


def test_the_special_frame_of_the_notes() -> None:
    """A the origin, the base along Y (north): X = S/(cot a + cot b) to the east, Y = S cot a/(cot a + cot b)."""
    a, b, S = np.radians(60.0), np.radians(50.0), 8.0
    cot = 1 / np.tan(a), 1 / np.tan(b)
    found = intersect(np.zeros(3), np.array([0.0, S, 0.0]), np.array([a, b, 0.0, 0.0]), left=False)
    np.testing.assert_allclose(found, [S / sum(cot), S * cot[0] / sum(cot), 0.0], atol=1e-14)


@pytest.mark.parametrize("left", [True, False])
def test_derivatives_by_complex_step(left: bool) -> None:
    z = np.concatenate([A, B, np.radians([62.0, 71.0, 12.0, -8.0])])
    wanted = complex_step(lambda z: intersect(z[:3], z[3:6], z[6:], left=left), z)
    np.testing.assert_allclose(derivatives(A, B, z[6:], left), wanted, rtol=1e-10, atol=1e-13)


def test_the_covariance_is_that_of_simulated_angles_and_stations() -> None:
    rng, P = np.random.default_rng(4), np.array([12.0, 29.0, 3.0])
    angles, sigma_m, sigma = _observed(P), np.full((2, 3), 2e-4), np.radians([2, 2, 3, 3]) / 3600
    found = forward_intersection(A, B, angles, sigma_m, sigma)
    n = 40_000
    made = np.array(
        [intersect(A + e[:3] * 2e-4, B + e[3:6] * 2e-4, angles + e[6:] * sigma) for e in rng.normal(size=(n, 10))]
    )
    np.testing.assert_allclose(np.std(made, axis=0), np.sqrt(np.diag(found.covariance_m2)), rtol=4 / np.sqrt(2 * n))
    np.testing.assert_allclose(made.mean(axis=0), P, atol=4e-6)


def test_the_formula_of_the_notes_is_the_trace_of_the_covariance() -> None:
    P, sigma, m = np.array([12.0, 29.0, 3.0]), np.radians(2.0) / 3600, 3e-4
    angles = _observed(P)
    sigma_m = np.array([[m, m, 0.0], [2 * m, 2 * m, 0.0]])
    found = forward_intersection(A, B, angles, sigma_m, np.array([sigma, sigma, 0.0, 0.0]))
    d_A, d_B = np.linalg.norm((P - A)[:2]), np.linalg.norm((P - B)[:2])
    base, gamma = np.linalg.norm((B - A)[:2]), np.pi - angles[0] - angles[1]
    told = plan_accuracy(d_A, d_B, gamma, sigma, m * np.sqrt(2), 2 * m * np.sqrt(2), base)
    assert found.plan_m == pytest.approx(told, rel=1e-12)


def test_a_bar_gives_the_scale_of_a_net_in_local_units() -> None:
    """Stations one unit apart; in truth 5.2 m: the bar of 2.0005 m brings all distances back."""
    true = 5.2
    ends = np.array([[1.0, 2.0], [2.6, 3.2]]) / true
    assert scale_of_bar(2.0, ends) == pytest.approx(true, rel=1e-14)
    assert scale_of_bar(2.0005, ends) / true == pytest.approx(1.00025, rel=1e-12)


def test_control_of_a_third_of_the_error_adds_five_percent() -> None:
    assert with_control_error(3.0, 1.0) / 3.0 == pytest.approx(1.054, abs=5e-4)
