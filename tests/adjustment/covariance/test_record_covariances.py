"""Covariances of the adjusted values of every record against the dense projector J Q J'."""

from __future__ import annotations

import numpy as np
import pytest

from aatri.adjustment.covariance.marginal import marginal_covariances
from aatri.adjustment.stepping.adjust import adjust_large
from aatri.adjustment.structure import index_problem as preparation
from aatri.adjustment.structure import layout
from tests.adjustment.block_problem import joined_problem, made_problem, shared_problem
from tests.adjustment.reference import dense_jacobian


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
