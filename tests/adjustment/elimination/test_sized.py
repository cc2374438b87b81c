"""Elimination and covariances for any pair of sizes against the general form, and large fronts shared out."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.adjustment.adjust import adjust_large
from aatri.adjustment.covariance.marginal import marginal_covariances
from aatri.adjustment.elimination import schedule
from aatri.adjustment.kernels.covariance import block_covariances
from aatri.adjustment.kernels.covariance_sized import covariances
from aatri.adjustment.kernels.eliminate import eliminate
from aatri.adjustment.kernels.eliminate_sized import eliminator
from tests.adjustment.block_problem import joined_problem, posed_problem

SIZES = ((3, 7), (3, 15), (1, 4), (2, 6))


def _rays(rng: np.random.Generator, m: int, k: int):
    """Blocks of one to five rays on eight places in random neighbourhoods; some rays meet what is held."""
    count = rng.integers(1, 6, 60)
    count[0] = 2
    ray_start = np.concatenate([[0], np.cumsum(count)]).astype(np.int64)
    place = np.concatenate([np.sort(rng.integers(0, 8, c)) for c in count])
    loc = np.where(rng.uniform(size=len(place)) < 0.1, -1, k * place).astype(np.int32)
    for p in range(len(count)):  # held ones come last, as vertices that are none do
        own = slice(ray_start[p], ray_start[p + 1])
        loc[own] = np.concatenate([loc[own][loc[own] >= 0], loc[own][loc[own] < 0]])
    n = len(place)
    A = rng.normal(size=(n, m, k)) * (loc >= 0)[:, None, None]
    return ray_start, loc[:, None], rng.normal(size=(n, m)), A, rng.normal(size=(n, m, 3))


@pytest.mark.parametrize("size", SIZES)
def test_any_pair_of_sizes_is_eliminated_as_by_the_general_form(size: tuple[int, int]) -> None:
    m, k = size
    rng = np.random.default_rng(m + k)
    ray_start, loc, v, A, B = _rays(rng, m, k)
    n = len(ray_start) - 1
    D0, free = np.tile(3.0 * np.eye(3), (n, 1, 1)), np.ones((n, 3))
    free[::7, 1] = 0.0
    h0 = rng.normal(size=(n, 3))
    found = []
    for function, parts in ((eliminator(m, k), ()), (eliminate, (np.array([k], np.int32), np.zeros(1, np.int32)))):
        F, g, d = np.zeros((8 * k, 8 * k), order="F"), np.zeros(8 * k), np.zeros(8 * k)
        L, y, low = np.ones((n, 6)), np.zeros((n, 3)), np.ones(n)
        cost = function(0, n, 0, ray_start, v, A, B, loc, *parts, D0, h0, free, 0.1, F, g, d, L, y, low)
        found.append((cost, np.tril(F), g, d, L, y, low))
    for one, other in zip(*found):
        np.testing.assert_allclose(one, other, rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize("size", SIZES)
def test_covariances_for_any_pair_of_sizes_are_those_of_the_general_form(size: tuple[int, int]) -> None:
    m, k = size
    rng = np.random.default_rng(m + k)
    ray_start, loc, _, A, B = _rays(rng, m, k)
    n = len(ray_start) - 1
    half = rng.normal(size=(8 * k, 8 * k))
    S = np.asfortranarray(half @ half.T)
    active = rng.uniform(size=len(loc)) > 0.2
    free, L = np.ones((n, 3)), np.abs(rng.normal(size=(n, 6))) + 1.0
    free[::7, 1] = 0.0
    row = np.where(loc >= 0, loc + np.arange(k), -1).astype(np.int64)
    found = []
    for function, place in ((covariances(m, k), loc), (block_covariances, row)):
        Q, R, X = (np.full(size, np.nan) for size in ((n, 3, 3), (len(loc), m, m), (len(loc), k, 3)))
        function(0, n, 0, ray_start, active, A, B, place, S, free, L, Q, R, X)
        found.append((Q, R, X))
    for one, other in zip(*found):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9 * np.abs(other).max())


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
