"""Distances of model points and their derivatives by the orientation."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from aatri.geometry.coplanarity import RayPairs, corrected
from aatri.geometry.intersection import intersect_pair, projection_coefficients
from aatri.geometry.rotations import skew
from aatri.geometry.vectors import tangents
from aatri.orientation.relative.distance_derivatives import log_distances
from tests.complex_step import complex_step
from tests.orientation.relative.pairs import rotation, simulate


def noisy_pair(seed: int) -> Any:
    rng = np.random.default_rng(seed)
    X = np.column_stack([rng.uniform(-0.2, 0.9, 25), rng.uniform(-0.6, 0.6, 25), rng.uniform(-1.2, -0.8, 25)])
    turned = [rotation(rng) for _ in range(2)]
    rays, R, base = simulate(X, *turned, np.zeros(3), np.array([0.6, 0.05, -0.02]), rng)
    sigma = rng.uniform(0.5, 2.0, rays.left_sigma.shape)
    return RayPairs(rays.left, rays.right, sigma * rays.left_sigma, rays.right_sigma), R, base


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_derivatives_of_distances_equal_the_complex_step(seed: int) -> None:
    rays, R, base = noisy_pair(seed)
    T = tangents(base)

    def f(p: Any) -> Any:  # first-order retraction: the same derivative at zero
        turned, moved = (np.eye(3) + skew(p[:3])) @ R, base + T @ p[3:]
        of = RayPairs(rays.left.astype(complex), rays.right.astype(complex), rays.left_sigma, rays.right_sigma)
        left, right = corrected(turned, moved, of)
        w = right @ turned.T
        depth = projection_coefficients(left, w, moved)
        X = 0.5 * (depth[:, :1] * left + moved + depth[:, 1:] * w)
        return 0.5 * np.log((X * X).sum(axis=1))

    log_r, J = log_distances(R, base, rays)
    expected = complex_step(f, np.zeros(5))
    assert np.abs(J - expected).max() <= 1e-10 * np.abs(expected).max()
    assert log_r == pytest.approx(np.log(np.linalg.norm(intersect_pair(R, base, rays).xyz, axis=1)), abs=1e-14)
