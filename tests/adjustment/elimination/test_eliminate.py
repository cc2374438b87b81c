"""Elimination of blocks for rays of any sizes against a dense Schur complement, and large fronts shared out."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.adjustment.covariance.marginal import marginal_covariances
from aatri.adjustment.elimination import schedule
from aatri.adjustment.kernels.eliminate import eliminate
from aatri.adjustment.stepping.adjust import adjust_large
from aatri.arrays import Bool, Float
from tests.adjustment.block_problem import joined_problem, posed_problem
from tests.adjustment.ray_places import BASE, PLACES, SIZES, RaysOnPlaces, rays_on

Normals = tuple[Float, Float, Float, float, Float]


def _dense(rays: RaysOnPlaces, D0: Float, h0: Float, free: Float, damping: float, chosen: Bool) -> Normals:
    """Normal equations of everything, the chosen blocks eliminated one by one by their inverses."""
    k = rays.columns
    F, g, d, cost = np.zeros((k, k)), np.zeros(k), np.zeros(k), 0.0
    for p in np.flatnonzero(chosen):
        rows = rays.rows(p)
        J = rays.jacobian(rows, np.ones(len(rays.v), dtype=bool))
        K, e = rays.B[rows].reshape(-1, 3) * free[p], rays.v[rows].ravel()
        D = K.T @ K + D0[p] * np.outer(free[p], free[p])
        D = D + np.diag(damping * np.diag(D) + (free[p] == 0))
        W, h = J.T @ K, K.T @ e + h0[p] * free[p]
        F += J.T @ J - W @ np.linalg.solve(D, W.T)
        g += J.T @ e - W @ np.linalg.solve(D, h)
        d += (J * J).sum(axis=0)
        cost += float(e @ e)
    return np.tril(F), g, d, cost, np.where(chosen, 1.0, 0.0)


def _eliminated(rays: RaysOnPlaces, D0: Float, h0: Float, free: Float, damping: float) -> Normals:
    k, n = rays.columns, rays.blocks
    F, g, d = np.zeros((k, k), order="F"), np.zeros(k), np.zeros(k)
    L, y, determined = np.ones((n, 6)), np.zeros((n, 3)), np.ones(n)
    cost = eliminate(
        0,
        n,
        BASE,
        rays.ray_start,
        rays.v,
        rays.A,
        rays.B,
        rays.loc,
        rays.size,
        rays.start,
        D0,
        h0,
        free,
        damping,
        F,
        g,
        d,
        L,
        y,
        determined,
    )
    return np.tril(F), g, d, cost, determined


@pytest.mark.parametrize("size", SIZES, ids=str)
@pytest.mark.parametrize("name", PLACES)
def test_blocks_are_eliminated_as_by_a_dense_schur_complement(name: str, size: tuple[int, tuple[int, ...]]) -> None:
    rays = rays_on(PLACES[name], *size, 7)
    rng, n = np.random.default_rng(8), rays.blocks
    half = rng.normal(size=(n, 3, 3))
    D0, h0, free = half @ half.swapaxes(1, 2), rng.normal(size=(n, 3)), np.ones((n, 3))
    free[::3, 1] = 0.0
    for damping in (0.0, 0.3):
        expected = _dense(rays, D0, h0, free, damping, np.ones(n, dtype=bool))
        for found, wanted in zip(_eliminated(rays, D0, h0, free, damping), expected):
            np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-11 * np.abs(wanted).max())


@pytest.mark.parametrize("parts", [(6,), (6, 3)])
def test_a_block_that_is_not_determined_is_marked_and_adds_nothing(parts: tuple[int, ...]) -> None:
    rays = rays_on([[0, 1], [0], [0, 1]], 2, parts, 3)
    nothing = np.zeros((3, 3, 3)), np.zeros((3, 3)), np.ones((3, 3)), 0.0
    found, expected = _eliminated(rays, *nothing), _dense(rays, *nothing, np.array([True, False, True]))
    np.testing.assert_array_equal(found[4], expected[4])
    np.testing.assert_allclose(found[0], expected[0], atol=1e-12 * np.abs(expected[0]).max())


@pytest.mark.parametrize("maker", [posed_problem, joined_problem])
def test_the_rays_of_one_front_are_shared_out_in_parts_that_do_not_depend_on_the_threads(
    monkeypatch: pytest.MonkeyPatch, maker
) -> None:
    unknowns, records, start = maker(1, n_kept=14, n_points=40)
    whole = adjust_large(unknowns, records, start)
    expected = marginal_covariances(whole)
    monkeypatch.setattr(schedule, "STRETCH", 11)
    monkeypatch.setattr(schedule, "PARALLEL_FLOPS", 0.0)
    found = [adjust_large(unknowns, records, start, threads=threads) for threads in (1, 2, 3)]
    assert len(schedule.stretches(found[0].problem)) > 5
    for group in start:
        np.testing.assert_allclose(found[0].state[group], whole.state[group], atol=1e-12)
        for other in found[1:]:
            np.testing.assert_array_equal(other.state[group], found[0].state[group])
    for result in found:
        covariance = marginal_covariances(result)
        for one, other in zip(covariance.records, expected.records):
            np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-12)
