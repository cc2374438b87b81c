"""Gains of every record against dense algebra: how an error of an observation moves the blocks it touches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.adjustment.covariance.marginal import marginal_covariances
from aatri.adjustment.stepping.adjust import adjust_large
from aatri.adjustment.structure import index_problem as preparation
from aatri.adjustment.structure import layout
from tests.adjustment.covariance.test_predicted import MAKERS, _relation, some_off
from tests.adjustment.reference import constrained_reference, dense_jacobian, free_columns


@pytest.mark.parametrize("most_rays", [2, 200])
@pytest.mark.parametrize("constrained", [False, True])
@pytest.mark.parametrize("maker", MAKERS)
def test_gains_are_the_covariance_of_the_unknowns_with_the_observations(
    monkeypatch: pytest.MonkeyPatch, maker: str, constrained: bool, most_rays: int
) -> None:
    """K = Q J', of records in use and of those that are not, of rays of eliminated and of retained points."""
    monkeypatch.setattr(preparation, "DENSE_VERTICES", 2)
    monkeypatch.setattr(layout, "MOST_RAYS", most_rays)
    unknowns, records, start = MAKERS[maker](1, n_kept=14, n_points=40)
    records = some_off(records)
    constraints = [_relation("a", start["a"].shape[1])] if constrained else []
    result = adjust_large(unknowns, records, start, constraints=constraints)
    A, v = dense_jacobian(unknowns, records, result.state)
    J, _ = dense_jacobian(unknowns, [replace(r, active=np.ones_like(r.active)) for r in records], result.state)
    Q = np.linalg.inv(A.T @ A)
    if constraints:
        Q = constrained_reference(A, v, *dense_jacobian(unknowns, constraints, result.state))[1]
    everything, column = Q @ J.T, free_columns(unknowns)
    found = marginal_covariances(result, gains_of=("a", "p")).gains
    first = 0
    for r, gains in zip(records, found):
        for (group, block), gain in zip(r.touches, gains.gain):
            if group not in ("a", "p"):
                assert gain is None
                continue
            for row in range(len(r.active)):
                own = slice(first + row * r.rows, first + (row + 1) * r.rows)
                at = column[group][block[row]]
                wanted = np.where((at >= 0)[:, None], everything[at, own], 0.0)
                np.testing.assert_allclose(gain[row], wanted, rtol=1e-7, atol=1e-11)
        first += len(r.active) * r.rows


def test_without_being_asked_there_are_none() -> None:
    unknowns, records, start = MAKERS["plain"](1)
    assert marginal_covariances(adjust_large(unknowns, records, start)).gains == ()
