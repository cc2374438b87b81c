"""Covariances of blocks, pairs, records and of two parts together."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.adjustment.covariance.cross import covariances_of_pairs, joint_covariance
from aatri.adjustment.covariance.marginal import covariances_at, marginal_covariances
from aatri.adjustment.elimination.fronts import factorise
from aatri.adjustment.kernels.covariance import block_covariances
from aatri.adjustment.stepping.adjust import adjust_large
from aatri.adjustment.structure import index_problem as preparation
from aatri.adjustment.structure import layout
from tests.adjustment.block_problem import joined_problem, made_problem, shared_problem
from tests.adjustment.ray_places import BASE, PLACES, SIZES, rays_on
from tests.adjustment.reference import dense_jacobian, free_columns

# Covariances of eliminated blocks and their rays, of any sizes, against dense algebra.


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
    R, X = np.full((len(every), m, m), np.nan), np.full((len(every), rays.size.sum(), 3), np.nan)
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
            wanted_R[r] = full[m * i : m * i + m, m * i : m * i + m]
    block_covariances(
        0, n, BASE, rays.ray_start, active, rays.A, rays.B, rays.loc, rays.size, rays.start, S, free, L, Q, R, X
    )
    for found, wanted in ((Q, wanted_Q), (R, wanted_R), (X, wanted_X)):
        np.testing.assert_allclose(found, wanted, atol=1e-10 * np.nanmax(np.abs(wanted)))


# Covariances of pairs of blocks against the dense inverse.

PAIRS = {
    made_problem: [(("a", 0), ("a", 13)), (("a", 1), ("p", 30)), (("p", 4), ("p", 39)), (("p", 7), ("a", 2))],
    joined_problem: [(("a", 0), ("f", 9)), (("f", 2), ("p", 8)), (("p", 1), ("p", 2))],
    shared_problem: [(("c", 0), ("c", 1)), (("p", 3), ("p", 20)), (("c", 1), ("p", 5))],
}


@pytest.mark.parametrize("maker", PAIRS)
def test_covariances_of_pairs_equal_the_dense_inverse(monkeypatch: pytest.MonkeyPatch, maker) -> None:
    monkeypatch.setattr(preparation, "DENSE_VERTICES", 2)
    unknowns, records, start = maker(4, n_kept=14, n_points=40)
    result = adjust_large(unknowns, records, start)
    J, _ = dense_jacobian(unknowns, records, result.state)
    Q = np.pad(np.linalg.inv(J.T @ J), (0, 1))
    columns = free_columns(unknowns)
    found = covariances_of_pairs(result, PAIRS[maker])
    for ((g, i), (h, j)), covariance in zip(PAIRS[maker], found):
        expected = Q[np.ix_(columns[g][i], columns[h][j])]
        np.testing.assert_allclose(covariance, expected, rtol=1e-8, atol=1e-12)


@pytest.mark.parametrize("block", [("a", 0), ("p", 0)])
def test_a_block_with_itself_has_its_own_covariance(block: tuple[str, int]) -> None:
    unknowns, records, start = made_problem()
    result = adjust_large(unknowns, records, start)
    J, _ = dense_jacobian(unknowns, records, result.state)
    Q, own = np.pad(np.linalg.inv(J.T @ J), (0, 1)), free_columns(unknowns)[block[0]][block[1]]
    (covariance,) = covariances_of_pairs(result, [(block, block)])
    np.testing.assert_allclose(covariance, Q[np.ix_(own, own)], rtol=1e-8, atol=1e-12)


# Covariances of the adjusted values of every record against the dense projector J Q J'.


@pytest.mark.parametrize("maker", [made_problem, joined_problem, shared_problem])
def test_every_record_gets_the_covariance_of_its_adjusted_values(monkeypatch: pytest.MonkeyPatch, maker) -> None:
    """Rays of eliminated and of retained points, priors, direct observations of points, relations."""
    monkeypatch.setattr(preparation, "DENSE_VERTICES", 2)
    unknowns, records, start = maker(1, n_kept=14, n_points=40)
    result = adjust_large(unknowns, records, start)
    J, _ = dense_jacobian(unknowns, records, result.state)
    hat = J @ np.linalg.inv(J.T @ J) @ J.T
    first = 0
    for r, found in zip(records, marginal_covariances(result).records):
        for row in range(len(r.active)):
            own = slice(first + row * r.rows, first + (row + 1) * r.rows)
            if r.active[row]:
                np.testing.assert_allclose(found[row], hat[own, own], rtol=1e-8, atol=1e-12)
        first += len(r.active) * r.rows


def test_redundancy_numbers_of_all_records_sum_to_the_redundancy_with_points_retained_for_their_many_rays(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(preparation, "DENSE_VERTICES", 2)
    monkeypatch.setattr(layout, "MOST_RAYS", 2)
    unknowns, records, start = made_problem(1, n_kept=14, n_points=40)
    result = adjust_large(unknowns, records, start)
    assert result.problem.rays is None or len(result.problem.rays.block) < 40
    found = marginal_covariances(result).records
    redundancy = sum(np.sum(1 - np.einsum("nii->ni", c[r.active])) for r, c in zip(records, found))
    np.testing.assert_allclose(redundancy, result.redundancy, rtol=1e-9)


@pytest.mark.parametrize("maker", [made_problem, joined_problem, shared_problem])
def test_a_factor_given_back_on_the_way_down_gives_the_same_covariances(monkeypatch: pytest.MonkeyPatch, maker) -> None:
    monkeypatch.setattr(preparation, "DENSE_VERTICES", 2)
    result = adjust_large(*maker(1, n_kept=14, n_points=40))
    kept, released = (factorise(result.problem, result.state) for _ in range(2))
    expected = covariances_at(result.problem, result.state, kept)
    found = covariances_at(result.problem, result.state, released, release=True)
    assert sum(kept.factor.panel(k).size for k in range(len(result.problem.tree.nodes))) > 0
    assert sum(released.factor.panel(k).size for k in range(len(result.problem.tree.nodes))) == 0
    for name, values in expected.groups.items():
        np.testing.assert_array_equal(found.groups[name], values)
    for record, values in zip(found.records, expected.records):
        np.testing.assert_array_equal(record, values)


# The joint covariance of many blocks against the dense inverse.

GROUPS = [(made_problem, "p"), (made_problem, "a"), (joined_problem, "p"), (joined_problem, "f"), (shared_problem, "c")]


@pytest.mark.parametrize(("maker", "group"), GROUPS)
def test_the_joint_covariance_is_that_of_the_dense_inverse(monkeypatch: pytest.MonkeyPatch, maker, group: str) -> None:
    monkeypatch.setattr(preparation, "DENSE_VERTICES", 2)
    unknowns, records, start = maker(4, n_kept=14, n_points=40)
    result = adjust_large(unknowns, records, start)
    J, _ = dense_jacobian(unknowns, records, result.state)
    Q = np.pad(np.linalg.inv(J.T @ J), (0, 1))
    of_group = free_columns(unknowns)[group]
    blocks = np.array([1, 0, *range(3, len(of_group), 3)])
    columns = of_group[blocks].ravel()
    np.testing.assert_allclose(joint_covariance(result, group, blocks), Q[np.ix_(columns, columns)], 1e-8, 1e-12)
