"""Covariances of records that are not active: of their predicted values, J Q J', against dense algebra."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.adjustment.covariance.marginal import marginal_covariances
from aatri.adjustment.records import Records
from aatri.adjustment.stepping.adjust import adjust_large
from aatri.adjustment.structure import index_problem as preparation
from aatri.adjustment.whitening import whitener_of_covariances
from tests.adjustment.block_problem import joined_problem, made_problem, posed_problem, shared_problem
from tests.adjustment.reference import constrained_reference, dense_jacobian

MAKERS = {"plain": made_problem, "posed": posed_problem, "joined": joined_problem, "shared": shared_problem}


def some_off(records):
    """A ray of every third point and every fifth record of the other kinds is not active."""
    number = [np.arange(len(r.active)) for r in records]
    off = [number[0] % 9 == 4, *(k % 5 == 2 for k in number[1:])]
    return tuple(replace(r, active=r.active & ~o) for r, o in zip(records, off))


def _relation(group: str, size: int, number: int = 2) -> Records:
    """The first scalars of neighbouring blocks are equal."""
    here, there = np.arange(number, dtype=np.int32), np.arange(1, number + 1, dtype=np.int32)
    J = np.zeros((number, 1, size))
    J[:, 0, 0] = 1.0

    def evaluate(state, rows):
        difference = state[group][here[rows], :1] - state[group][there[rows], :1] - 0.1
        return difference, (J[rows], -J[rows])

    return Records("equal", ((group, here), (group, there)), evaluate, np.ones((number, 1)), np.ones(number, bool))


def _expected(unknowns, records, constraints, state):
    """J Q J' of all records, Q of the active ones."""
    A, v = dense_jacobian(unknowns, records, state)
    everything, _ = dense_jacobian(unknowns, [replace(r, active=np.ones_like(r.active)) for r in records], state)
    if constraints:
        C, c = dense_jacobian(unknowns, constraints, state)
        Q = constrained_reference(A, v, C, c)[1]
    else:
        Q = np.linalg.inv(A.T @ A)
    return everything @ Q @ everything.T


@pytest.mark.parametrize("fronts", [2, 80])
@pytest.mark.parametrize("constrained", [False, True])
@pytest.mark.parametrize("maker", MAKERS)
def test_records_that_are_not_active_get_the_covariance_of_their_predicted_values(
    monkeypatch: pytest.MonkeyPatch, maker: str, constrained: bool, fronts: int
) -> None:
    monkeypatch.setattr(preparation, "DENSE_VERTICES", fronts)
    unknowns, records, start = MAKERS[maker](1, n_kept=14, n_points=40)
    records = some_off(records)
    assert all(not r.active.all() for r in records[:2])
    constraints = [_relation("a", start["a"].shape[1])] if constrained else []
    result = adjust_large(unknowns, records, start, constraints=constraints)
    wanted = _expected(unknowns, records, constraints, result.state)
    first = 0
    for r, found in zip(records, marginal_covariances(result).records):
        for row in range(len(r.active)):
            own = slice(first + row * r.rows, first + (row + 1) * r.rows)
            np.testing.assert_allclose(found[row], wanted[own, own], rtol=1e-7, atol=1e-11)
        first += len(r.active) * r.rows


def test_the_solution_is_that_of_the_active_records_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(preparation, "DENSE_VERTICES", 2)
    unknowns, records, start = joined_problem(1, n_kept=14, n_points=40)
    some = some_off(records)

    def alone(r: Records) -> Records:
        """Without the rows that are not active, of which nothing can be known."""
        rows = np.flatnonzero(r.active)
        touches = tuple((group, blocks[rows]) for group, blocks in r.touches)
        return Records(r.name, touches, lambda state, k: r.evaluate(state, rows[k]), r.whitener[rows], r.active[rows])

    found = adjust_large(unknowns, some, start, tolerance=1e-9)
    wanted = adjust_large(unknowns, [alone(r) for r in some], start, tolerance=1e-9)
    assert (found.observations, found.n_unknowns) == (wanted.observations, wanted.n_unknowns)
    assert found.cost == pytest.approx(wanted.cost, rel=1e-9)
    for group in start:
        np.testing.assert_allclose(found.state[group], wanted.state[group], atol=1e-9)
    groups, expected = marginal_covariances(found).groups, marginal_covariances(wanted).groups
    for group in start:
        np.testing.assert_allclose(groups[group], expected[group], rtol=1e-8, atol=1e-12)


def test_an_inactive_record_without_finite_residual_harms_nothing_but_its_own_prediction() -> None:
    unknowns, records, start = made_problem(1, n_kept=14, n_points=40)
    whole = records[0].evaluate

    def broken(state, rows):
        v, (a, p) = whole(state, rows)
        bad = (rows == 2)[:, None]
        return np.where(bad, np.nan, v), (np.where(bad[:, :, None], np.inf, a), np.where(bad[:, :, None], np.nan, p))

    found = adjust_large(unknowns, (replace(records[0], evaluate=broken), *records[1:]), start)
    wanted = adjust_large(unknowns, records, start)
    assert found.cost == pytest.approx(wanted.cost, rel=1e-12)
    of, expected = marginal_covariances(found), marginal_covariances(wanted)
    assert np.isnan(of.rays[2]).any()
    for one, other in ((of.rays, expected.rays), (of.groups["p"], expected.groups["p"])):
        finite = np.isfinite(one).reshape(len(one), -1).all(axis=1)
        np.testing.assert_allclose(one[finite], other[finite], rtol=1e-9, atol=1e-12)
    assert not np.isnan(np.delete(of.rays, 2, axis=0)).any()


def test_full_whiteners_of_inactive_records_count_in_their_prediction() -> None:
    """A record of covariance S has the whitened prediction L^-1 J Q J' L^-T, S = L L'."""
    unknowns, records, start = made_problem(3, n_kept=8, n_points=20)
    S = np.array([[4.0, 1.5], [1.5, 1.0]])
    whitener = np.tile(whitener_of_covariances(S[None]), (len(records[0].active), 1, 1))
    active = records[0].active.copy()
    active[10] = False
    found = []
    for w in (whitener, np.broadcast_to(np.eye(2), whitener.shape)):
        kept = np.where(active[:, None, None], records[0].whitener, w)
        r = replace(records[0], whitener=kept, active=active)
        found.append(marginal_covariances(adjust_large(unknowns, (r, records[1]), start)).rays[10])
    half = np.linalg.cholesky(S)
    np.testing.assert_allclose(half @ found[0] @ half.T, found[1], rtol=1e-9)
