"""Covariances of eliminated blocks and their rays, of any sizes, against dense algebra."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.adjustment.kernels.covariance import block_covariances
from tests.adjustment.ray_places import BASE, PLACES, SIZES, rays_on


@pytest.mark.parametrize("size", SIZES, ids=str)
@pytest.mark.parametrize("name", PLACES)
def test_blocks_and_rays_have_the_covariances_of_the_dense_system(name: str, size: tuple[int, tuple[int, ...]]) -> None:
    """With S of the kept unknowns and W = A'B D^-1: C = [[S, -S W], [-W'S, D^-1 + W'S W]], and J C J' of the rays.

    Rays that are not active are no part of W, and predicted.
    """
    rays, rng = rays_on(PLACES[name], *size, 11), np.random.default_rng(12)
    n, m, every = rays.blocks, size[0], np.ones(len(rays.v), dtype=bool)
    active = (rng.uniform(size=len(every)) > 0.2) | (rays.loc < 0).any(axis=1)
    half = rng.normal(size=(rays.columns, rays.columns))
    S = np.asfortranarray(half @ half.T)
    free = np.ones((n, 3))
    free[::4, 2] = 0.0
    L, Q = np.empty((n, 6)), np.full((n, 3, 3), np.nan)
    R, X = np.full((rays.ray_start[-1], m, m), np.nan), np.full((len(every), rays.size.sum(), 3), np.nan)
    wanted_Q, wanted_R, wanted_X = np.zeros_like(Q), np.full_like(R, np.nan), np.zeros_like(X)
    for p in range(n):
        rows = rays.rows(p)
        J, K = rays.jacobian(rows, active), rays.B[rows].reshape(-1, 3) * free[p]
        D = K.T @ K + 2.0 * np.eye(3)
        factor = np.linalg.cholesky(np.where(np.outer(free[p], free[p]) > 0, D, np.eye(3)))
        L[p] = factor[np.tril_indices(3)][[0, 1, 3, 2, 4, 5]]
        inverse = np.linalg.inv(factor @ factor.T) * np.outer(free[p], free[p])
        W = J.T @ K @ inverse
        wanted_Q[p] = inverse + W.T @ S @ W
        for r in rows:
            for c, k, s in zip(rays.loc[r], rays.size, rays.start):
                wanted_X[r, s : s + k] = (S @ W)[c : c + k] if c >= 0 else 0.0
        joint = np.block([[S, -S @ W], [-(S @ W).T, wanted_Q[p]]])
        both = np.hstack([rays.jacobian(rows, every), rays.B[rows].reshape(-1, 3)])
        full = both @ joint @ both.T
        for i, r in enumerate(rows):
            wanted_R[BASE + r] = full[m * i : m * i + m, m * i : m * i + m]
    block_covariances(m, rays.size)(
        0, n, BASE, rays.ray_start, active, rays.A, rays.B, rays.loc, rays.size, rays.start, S, free, L, Q, R, X
    )
    for found, wanted in ((Q, wanted_Q), (R, wanted_R), (X, wanted_X)):
        np.testing.assert_allclose(found, wanted, atol=1e-10 * np.nanmax(np.abs(wanted)))
