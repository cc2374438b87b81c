"""Covariances of points of single poses against dense algebra."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.adjustment.kernels.covariance_sized import covariances
from tests.adjustment.elimination.test_eliminate_pose import BASE, PLACES, _rays


@pytest.mark.parametrize("name", PLACES)
def test_blocks_and_rays_have_the_covariances_of_the_dense_system(name: str) -> None:
    """With S of the kept unknowns and W = A'B D^-1: C = [[S, -S W], [-W'S, D^-1 + W'S W]], and J C J' of the rays."""
    rng, places = np.random.default_rng(11), PLACES[name]
    ray_start, loc, _, A, B = _rays(rng, places)
    images, n = 1 + max(max(own) for own in places), len(places)
    half = rng.normal(size=(6 * images, 6 * images))
    S = np.asfortranarray(half @ half.T)
    free = np.ones((n, 3))
    free[::4, 2] = 0.0
    L, Q, R = np.empty((n, 6)), np.full((n, 3, 3), np.nan), np.full((ray_start[-1], 2, 2), np.nan)
    wanted_Q, wanted_R = np.zeros_like(Q), np.full_like(R, np.nan)
    wanted_X = np.full((len(A), 6, 3), np.nan)
    for p, own in enumerate(places):
        rows = np.arange(ray_start[p], ray_start[p + 1]) - BASE
        J, K = np.zeros((2 * len(own), 6 * images)), B[rows].reshape(-1, 3) * free[p]
        for i, (r, c) in enumerate(zip(rows, own)):
            if c >= 0:
                J[2 * i : 2 * i + 2, 6 * c : 6 * c + 6] += A[r]
        D = K.T @ K + 2.0 * np.eye(3)
        factor = np.linalg.cholesky(np.where(np.outer(free[p], free[p]) > 0, D, np.eye(3)))
        L[p] = factor[np.tril_indices(3)][[0, 1, 3, 2, 4, 5]]
        inverse = np.linalg.inv(factor @ factor.T) * np.outer(free[p], free[p])
        W = J.T @ K @ inverse
        wanted_Q[p] = inverse + W.T @ S @ W
        for r, c in zip(rows, own):
            wanted_X[r] = (S @ W)[6 * c : 6 * c + 6] if c >= 0 else 0.0
        joint = np.block([[S, -S @ W], [-(S @ W).T, wanted_Q[p]]])
        both = np.hstack([J, B[rows].reshape(-1, 3)])
        full = both @ joint @ both.T
        for i, r in enumerate(rows):
            wanted_R[BASE + r] = full[2 * i : 2 * i + 2, 2 * i : 2 * i + 2]
    X = np.full((len(A), 6, 3), np.nan)
    covariances(2, 6)(0, n, BASE, ray_start, np.ones(len(A), bool), A, B, loc, S, free, L, Q, R, X)
    np.testing.assert_allclose(Q, wanted_Q, atol=1e-11 * np.abs(wanted_Q).max())
    np.testing.assert_allclose(R, wanted_R, atol=1e-10 * np.nanmax(np.abs(wanted_R)))
    np.testing.assert_allclose(X, wanted_X, atol=1e-10 * np.nanmax(np.abs(wanted_X)))
