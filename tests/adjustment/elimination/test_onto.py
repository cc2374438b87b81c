"""Normal equations reduced onto chosen unknowns against dense elimination of all others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.adjustment.elimination.onto import reduced_onto, without
from aatri.adjustment.problem import Problem, SolverSettings
from aatri.adjustment.structure.index_problem import indexed
from tests.adjustment.block_problem import made_problem
from tests.adjustment.reference import dense_jacobian


@pytest.mark.parametrize(("n_kept", "rays"), [(6, 3), (40, 4)])
@pytest.mark.parametrize("chosen", ["a", "p", "both"])
def test_reduced_normal_equations_are_those_of_dense_elimination(n_kept: int, rays: int, chosen: str) -> None:
    unknowns, records, state = made_problem(2, n_kept=n_kept, n_points=3 * n_kept, rays=rays)
    keep = {
        "p": np.arange(3 * n_kept) % 5 == 1 if chosen != "a" else np.zeros(3 * n_kept, dtype=bool),
        "a": np.arange(n_kept) % 4 == 0 if chosen != "p" else np.zeros(n_kept, dtype=bool),
    }
    last = [
        replace(u, retained=keep["p"])
        if u.eliminated
        else replace(u, position=np.where(keep["a"][:, None], np.nan, u.position))
        for u in unknowns
    ]
    problem = indexed(Problem(tuple(last), records), SolverSettings(ordering="nested_dissection"))
    columns = [problem.layout.columns(u.name, u.size)[keep[u.name]].ravel() for u in unknowns]
    columns = np.concatenate(columns)
    N, g, cost = reduced_onto(problem, state, columns[columns >= 0])

    J, v = dense_jacobian(unknowns, records, state)
    own = np.concatenate([np.repeat(keep[u.name], u.size)[u.free.ravel()] for u in unknowns])
    own, other = np.flatnonzero(own), np.flatnonzero(~own)
    A, B = J[:, own], J[:, other]
    across = np.eye(len(v)) - B @ np.linalg.pinv(B)  # onto what the others cannot take up
    np.testing.assert_allclose(N, A.T @ across @ A, atol=1e-9 * np.abs(N).max())
    np.testing.assert_allclose(g, A.T @ across @ v, atol=1e-9 * np.abs(g).max())
    assert cost == pytest.approx(v @ across @ v, rel=1e-9)


def test_what_nothing_determines_is_eliminated_as_far_as_it_is() -> None:
    J = np.random.default_rng(1).normal(size=(5, 6)) * [1.0, 1e3, 1e-3, 1.0, 1.0, 1.0]
    v, own, other = np.arange(5.0), np.array([3, 5]), np.array([0, 1, 2, 4])
    J[:, 2] = 1e-6 * J[:, 1]
    N, g, fall, rank = without(J.T @ J, J.T @ v, own, other)
    U = np.linalg.svd(J[:, other])[0][:, :3]  # what the others can explain
    P = np.eye(5) - U @ U.T
    assert rank == 3
    np.testing.assert_allclose(N, J[:, own].T @ P @ J[:, own], rtol=1e-9)
    np.testing.assert_allclose(g, J[:, own].T @ P @ v, rtol=1e-9)
    assert fall == pytest.approx(v @ v - v @ P @ v, rel=1e-9)
