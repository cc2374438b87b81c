"""The joint covariance of many blocks against the dense inverse."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.adjustment.covariance.cross import joint_covariance
from aatri.adjustment.stepping.adjust import adjust_large
from aatri.adjustment.structure import index_problem as preparation
from tests.adjustment.block_problem import joined_problem, made_problem, shared_problem
from tests.adjustment.reference import dense_jacobian, free_columns

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
