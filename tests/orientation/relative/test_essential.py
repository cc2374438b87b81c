"""Five-point essential matrix against its definition."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.geometry.coplanarity import RayPairs, essential_matrix
from aatri.geometry.rotations import exp_rotation
from aatri.orientation.relative.essential import decompositions, essential_starts, five_point
from tests.orientation.relative.pairs import gruber_ground, rotation, simulate


def _pair(rng, n, planar=False, turn=None):
    """Points in front of two images; the right one is turned at random."""
    R = exp_rotation(rng.normal(size=3) * 0.3 if turn is None else turn)
    b = rng.normal(size=3)
    b /= np.linalg.norm(b)
    X = np.column_stack([rng.uniform(-1, 1, (n, 2)) * 2, np.full(n, -3.0) if planar else rng.uniform(-4, -2.5, n)])
    return R, b, X, (X - b) @ R


@pytest.mark.parametrize("planar", [False, True])
def test_five_point_solutions_satisfy_the_definition_and_hold_the_truth(planar):
    rng = np.random.default_rng(3)
    R, b, u1, u2 = _pair(rng, 5, planar)
    E = five_point(u1[None], u2[None])
    assert 1 <= len(E) <= 10
    for e in E:
        assert abs(np.linalg.det(e)) < 1e-8
        np.testing.assert_allclose(2 * e @ e.T @ e - np.trace(e @ e.T) * e, 0, atol=1e-8)
        np.testing.assert_allclose(np.einsum("ni,ij,nj->n", u1, e, u2), 0, atol=1e-10)
    truth = essential_matrix(R, b)
    nearest = min(min(np.abs(e - truth).max(), np.abs(e + truth).max()) for e in E)
    assert nearest < 1e-8


def test_an_essential_matrix_decomposes_into_its_rotation_and_base():
    R, b, _, _ = _pair(np.random.default_rng(1), 5)
    found = decompositions(essential_matrix(R, b))
    assert min(np.abs(r - R).max() + np.abs(t - b).max() for r, t in found) < 1e-14
    assert all(abs(np.linalg.det(r) - 1) < 1e-14 for r, _ in found)


def test_half_of_the_points_wrong_is_survived():
    rng = np.random.default_rng(8)
    R, b, u1, u2 = _pair(rng, 60)
    left, right = (-100 * u / u[:, 2:] for u in (u1, u2))
    assert (u2[:, 2] < 0).all()
    right[:30, :2] += rng.uniform(-40, 40, (30, 2))
    sigma = np.full((60, 2), 0.005)
    found_R, found_b = essential_starts(RayPairs(left, right, sigma, sigma))[0]
    np.testing.assert_allclose(found_R, R, atol=1e-6)
    np.testing.assert_allclose(found_b, b, atol=1e-6)


def test_the_first_start_over_flat_ground_has_the_points_in_front():
    """A plane has a second orientation, often with points behind, that explains the rays of noisy points as well."""
    rng = np.random.default_rng(3)
    for _ in range(25):
        X = gruber_ground(6, rng, relief=0.0)
        rays, R, b = simulate(X, rotation(rng), rotation(rng), np.zeros(3), np.array([0.6, 0.02, -0.01]), rng)
        left_from_right, base = essential_starts(rays)[0]
        assert np.abs(left_from_right - R).max() < 0.1
        assert base @ b > 0.9
