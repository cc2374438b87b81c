"""Elimination of points of single poses against a dense Schur complement."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.adjustment.kernels.eliminate_pose import GROUP, eliminate_pose

BASE = 5


def _rays(rng: np.random.Generator, places: list[list[int]]) -> tuple[np.ndarray, ...]:
    loc = np.array([6 * c if c >= 0 else -1 for rays in places for c in rays], dtype=np.int32)[:, None]
    ray_start = BASE + np.concatenate([[0], np.cumsum([len(rays) for rays in places])])
    n = len(loc)
    v, A, B = rng.normal(size=(n, 2)), rng.normal(size=(n, 2, 6)), rng.normal(size=(n, 2, 3))
    return ray_start, loc, v, A, B


def _dense(places, rays, D0, h0, free, damping, images):
    """Normal equations of everything, the points eliminated one by one by their inverses."""
    ray_start, _, v, A, B = rays
    F, g, d, cost = np.zeros((6 * images, 6 * images)), np.zeros(6 * images), np.zeros(6 * images), 0.0
    for p, own in enumerate(places):
        J = np.zeros((2 * len(own), 6 * images))
        rows = np.arange(ray_start[p], ray_start[p + 1]) - BASE
        for i, (r, c) in enumerate(zip(rows, own)):
            if c >= 0:
                J[2 * i : 2 * i + 2, 6 * c : 6 * c + 6] += A[r]
        K, e = B[rows].reshape(-1, 3) * free[p], v[rows].ravel()
        D = K.T @ K + D0[p] * np.outer(free[p], free[p])
        D = D + np.diag(damping * np.diag(D) + (free[p] == 0))
        W, h = J.T @ K, K.T @ e + h0[p] * free[p]
        F += J.T @ J - W @ np.linalg.solve(D, W.T)
        g += J.T @ e - W @ np.linalg.solve(D, h)
        d += (J * J).sum(axis=0)
        cost += e @ e
    return F, g, d, cost


def _neighbourhoods(rng: np.random.Generator, images: int, points: int) -> list[list[int]]:
    found = []
    for _ in range(points):
        first = int(rng.integers(0, images - 4))
        chosen = sorted(rng.choice(np.arange(first, first + 5), size=rng.integers(2, 5), replace=False).tolist())
        found.append(chosen)
    return sorted(found)


PLACES = {
    "like blocks, more than one group": [[0, 1, 2]] * (2 * GROUP + 3),
    "nearly like blocks": _neighbourhoods(np.random.default_rng(1), 12, 70),
    "blocks that meet nothing in common": [[0, 1], [2, 3], [4, 5], [6, 7]],
    "one block of many rays": [list(range(120))],
    "several rays of one image": [[0, 0, 1], [0, 1, 1], [1, 1, 1]],
    "poses that are held": [[-1, 0, 2], [0, 1, -1], [-1, -1]],
}


@pytest.mark.parametrize("damping", [0.0, 0.3])
@pytest.mark.parametrize("name", PLACES)
def test_blocks_are_eliminated_as_by_a_dense_schur_complement(name: str, damping: float) -> None:
    rng, places = np.random.default_rng(7), PLACES[name]
    rays, images = _rays(rng, places), 1 + max(max(own) for own in places)
    n = len(places)
    half = rng.normal(size=(n, 3, 3))
    D0, h0, free = half @ half.swapaxes(1, 2), rng.normal(size=(n, 3)), np.ones((n, 3))
    free[::3, 1] = 0.0
    expected = _dense(places, rays, D0, h0, free, damping, images)
    F, g, d = np.zeros((6 * images, 6 * images), order="F"), np.zeros(6 * images), np.zeros(6 * images)
    ray_start, loc, v, A, B = rays
    L, y, determined = np.ones((n, 6)), np.zeros((n, 3)), np.ones(n)
    cost = eliminate_pose(0, n, BASE, ray_start, v, A, B, loc, D0, h0, free, damping, F, g, d, L, y, determined)
    assert determined.all()
    for found, wanted in zip((np.tril(F), g, d, cost), (np.tril(expected[0]), *expected[1:])):
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-11 * np.abs(wanted).max())


def test_a_block_that_is_not_determined_is_marked_and_adds_nothing() -> None:
    rng, places = np.random.default_rng(3), [[0, 1], [0], [0, 1]]
    ray_start, loc, v, A, B = _rays(rng, places)
    F, g, d = np.zeros((12, 12), order="F"), np.zeros(12), np.zeros(12)
    L, y, determined = np.ones((3, 6)), np.zeros((3, 3)), np.ones(3)
    nothing = np.zeros((3, 3, 3)), np.zeros((3, 3)), np.ones((3, 3))
    eliminate_pose(0, 3, BASE, ray_start, v, A, B, loc, *nothing, 0.0, F, g, d, L, y, determined)
    np.testing.assert_array_equal(determined, [1, 0, 1])
    others = _dense(places[:1], (ray_start[:2], loc, v, A, B), *nothing, 0.0, 2)[0]
    others = others + _dense(places[2:], (ray_start[2:], loc, v, A, B), *nothing, 0.0, 2)[0]
    np.testing.assert_allclose(np.tril(F), np.tril(others), atol=1e-12 * np.abs(others).max())
