"""The factor of a matrix in blocks against dense linear algebra."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_array

from aatri.adjustment.elimination.block_matrix import block_matrix


def _near_ones_meet(rng: np.random.Generator, reach: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A normal matrix, the vertex of each row, and their places: 13 vertices of 2 to 5 rows, near ones in common."""
    position, vertex = rng.random((13, 2)), np.repeat(np.arange(13), rng.integers(2, 6, 13))
    N = np.eye(len(vertex))
    for j, k in zip(*np.triu_indices(13, 1)):
        if np.linalg.norm(position[j] - position[k]) < reach:
            rows = np.flatnonzero((vertex == j) | (vertex == k))
            A = rng.normal(size=(8, len(rows)))
            N[np.ix_(rows, rows)] += A.T @ A
    return N, vertex, position


@pytest.mark.parametrize("reach", [0.0, 0.3, 0.45, 2.0])
def test_solution_inverse_and_determinant_are_those_of_the_dense_matrix(reach: float) -> None:
    rng = np.random.default_rng(1)
    N, vertex, position = _near_ones_meet(rng, reach)
    scale, added, right = rng.uniform(0.5, 1.5, len(N)), rng.uniform(0.0, 1.0, len(N)), rng.normal(size=len(N))
    M = N * np.outer(scale, scale) + np.diag(added)
    factor = block_matrix(csr_array(N), vertex, position).factor(scale, added)
    assert factor is not None
    np.testing.assert_allclose(factor.solve(right), np.linalg.solve(M, right), atol=1e-13)
    np.testing.assert_allclose(factor.inverse_diagonal(), np.linalg.inv(M).diagonal(), atol=1e-13)
    assert factor.log_determinant == pytest.approx(np.linalg.slogdet(M)[1], rel=1e-13)


def test_a_matrix_that_is_not_positive_definite_has_no_factor() -> None:
    N, vertex, position = _near_ones_meet(np.random.default_rng(1), 0.45)
    matrix, smallest = block_matrix(csr_array(N), vertex, position), np.linalg.eigvalsh(N)[0]
    assert matrix.factor(np.ones(len(N)), np.full(len(N), -0.99 * smallest)) is not None
    assert matrix.factor(np.ones(len(N)), np.full(len(N), -1.01 * smallest)) is None
