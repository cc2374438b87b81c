"""Covariances of pairs of blocks against the dense inverse."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.adjustment.covariance.cross import covariances_of_pairs
from aatri.adjustment.stepping.adjust import adjust_large
from aatri.adjustment.structure import index_problem as preparation
from tests.adjustment.block_problem import joined_problem, made_problem, shared_problem
from tests.adjustment.reference import dense_jacobian, free_columns

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
