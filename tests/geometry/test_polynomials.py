"""Strip axes and polynomials."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.geometry.polynomials import correction_design, polynomial_rows, strip_axes

RNG = np.random.default_rng(3)


@pytest.mark.parametrize(("degree", "terms"), [(0, 1), (1, 3), (2, 5)])
def test_terms_of_each_degree(degree, terms):
    u, v = np.array([0.5, -1.0]), np.array([2.0, 0.25])
    expected = np.array([[1, 0.5, 2.0, 0.25, 1.0], [1, -1.0, 0.25, 1.0, -0.25]])
    np.testing.assert_array_equal(polynomial_rows(u, v, degree), expected[:, :terms])


def test_u_runs_along_the_flight_and_both_lie_between_minus_one_and_one():
    azimuth = 2.5
    along, across = np.array([np.cos(azimuth), np.sin(azimuth)]), np.array([-np.sin(azimuth), np.cos(azimuth)])
    centres = np.column_stack([np.outer(np.arange(5) * 200.0, along) + 4.5e6, np.full(5, 400.0)])
    t, w = RNG.uniform(-100, 900, 50), RNG.uniform(-200, 200, 50)
    points = np.column_stack([np.outer(t, along) + np.outer(w, across) + 4.5e6, RNG.normal(0, 5, 50)])
    axes = strip_axes(points, centres)
    np.testing.assert_allclose(axes.ground_from_axes[:2, 0], along, atol=1e-9)
    local = (points - axes.origin_m) @ axes.ground_from_axes / [*axes.half_range_m, 1.0]
    np.testing.assert_allclose([local[:, 0].min(), local[:, 0].max(), local[:, 1].max()], [-1, 1, 1], atol=1e-9)


def test_a_correction_along_v_moves_the_point_across_the_strip():
    centres = np.array([[0.0, 0.0, 400.0], [0.0, 600.0, 400.0]])  # flown to the north: U = Y, V = -X
    points = np.column_stack([RNG.uniform(-200, 200, 9), RNG.uniform(0, 600, 9), np.zeros(9)])
    design = correction_design(strip_axes(points, centres), points)
    constant_b = design[:, :, 5]
    np.testing.assert_allclose(constant_b, np.tile([-1.0, 0.0, 0.0], (9, 1)), atol=1e-12)
