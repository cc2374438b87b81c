"""Exact constraints against the dense system [N C'; C 0]."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from aatri.adjustment.covariance.cross import covariances_of_pairs
from aatri.adjustment.covariance.marginal import marginal_covariances
from aatri.adjustment.records import Records
from aatri.adjustment.stepping.adjust import adjust_large
from aatri.errors import GeometryError
from tests.adjustment.block_problem import _observed, joined_problem, made_problem, shared_problem
from tests.adjustment.reference import constrained_reference, dense_jacobian, free_columns
from tests.adjustment.test_solve import _many_fronts

MAKERS = {"plain": made_problem, "joined": joined_problem, "shared": shared_problem}


@pytest.fixture
def _small_fronts(monkeypatch: pytest.MonkeyPatch) -> None:
    _many_fronts(monkeypatch)


def _condition(rng: np.random.Generator, unknowns, name: str, *touches):
    """Two mildly non-linear conditions a row among the touched blocks."""
    sizes = {u.name: u.size for u in unknowns}
    blocks = tuple(np.array(block, dtype=np.int32) for _, block in touches)
    evaluate = _observed(rng, tuple((group, sizes[group]) for group, _ in touches), blocks)
    n = len(blocks[0])
    return Records(
        name, tuple((g, b) for (g, _), b in zip(touches, blocks)), evaluate, np.ones((n, 2)), np.ones(n, bool)
    )


def conditions(unknowns):
    """Among kept blocks far apart; on points alone; between points; between a point and kept blocks."""
    rng = np.random.default_rng(17)
    found = [
        _condition(rng, unknowns, "far", ("a", [0, 3]), ("a", [12, 9])),
        _condition(rng, unknowns, "on a point", ("p", [5, 21])),
        _condition(rng, unknowns, "between points", ("p", [10]), ("p", [33])),
        _condition(rng, unknowns, "mixed", ("p", [30]), ("a", [6]), ("p", [2])),
    ]
    found[0].whitener[1, 1] = 0.0
    return found


def _solved(unknowns, records, constraints, start):
    """Gauss-Newton by the dense system; state and covariance."""
    state = {k: x.copy() for k, x in start.items()}
    for _ in range(40):
        J, v = dense_jacobian(unknowns, records, state)
        C, c = dense_jacobian(unknowns, constraints, state)
        some = np.abs(C).max(axis=1) > 0
        dx, Q = constrained_reference(J, v, C[some], c[some])
        for u in unknowns:
            state[u.name] = state[u.name] + np.append(dx, 0.0)[free_columns(unknowns)[u.name]]
    return state, Q


@pytest.mark.slow
@pytest.mark.usefixtures("_small_fronts")
@pytest.mark.parametrize("maker", MAKERS)
def test_solution_and_covariances_under_constraints_equal_the_dense_reference(maker: str) -> None:
    unknowns, records, start = MAKERS[maker](1, n_kept=14, n_points=40)
    constraints = conditions(unknowns)
    result = adjust_large(unknowns, records, start, constraints=constraints, tolerance=1e-9, threads=2)
    assert len(result.problem.tree.nodes) > 2
    state, Q = _solved(unknowns, records, constraints, start)
    for name, value in state.items():
        np.testing.assert_allclose(result.state[name], value, atol=1e-8)
    assert np.abs(dense_jacobian(unknowns, constraints, result.state)[1]).max() < 1e-12
    found, padded, columns = marginal_covariances(result), np.pad(Q, (0, 1)), free_columns(unknowns)
    for name, c in columns.items():
        expected = padded[c[:, :, None], c[:, None, :]]
        np.testing.assert_allclose(found.groups[name], expected, rtol=1e-8, atol=1e-10)
    pairs = [(("a", 0), ("a", 13)), (("p", 5), ("a", 2)), (("p", 21), ("p", 33))]
    for ((g, i), (h, j)), block in zip(pairs, covariances_of_pairs(result, pairs)):
        np.testing.assert_allclose(block, padded[np.ix_(columns[g][i], columns[h][j])], rtol=1e-8, atol=1e-10)


@pytest.mark.slow(after=1)
@pytest.mark.usefixtures("_small_fronts")
@pytest.mark.parametrize("maker", MAKERS)
def test_redundancy_counts_the_constraints_and_is_the_sum_of_the_redundancy_numbers(maker: str) -> None:
    unknowns, records, start = MAKERS[maker](2, n_kept=14, n_points=40)
    free = adjust_large(unknowns, records, start)
    result = adjust_large(unknowns, records, start, constraints=conditions(unknowns), tolerance=1e-9)
    assert result.observations == free.observations
    assert result.redundancy == free.redundancy + 3 + 4 + 2 + 2
    assert result.sigma0 == pytest.approx(np.sqrt(result.cost / result.redundancy))
    found = marginal_covariances(result)
    J, _ = dense_jacobian(unknowns, records, result.state)
    _, Q = _solved(unknowns, records, conditions(unknowns), result.state)
    hat = np.einsum("ij,jk,ik->i", J, Q, J)[: 2 * len(found.rays)].reshape(-1, 2)
    some = records[0].active
    np.testing.assert_allclose(np.einsum("nii->ni", found.rays)[some], hat[some], rtol=1e-8, atol=1e-10)
    numbers = [np.sum(1 - np.einsum("nii->ni", c[r.active])) for r, c in zip(records, found.records)]
    np.testing.assert_allclose(sum(numbers), result.redundancy, rtol=1e-9)


@pytest.mark.usefixtures("_small_fronts")
def test_a_block_that_only_constraints_determine_is_determined() -> None:
    unknowns, records, start = made_problem(3, n_kept=14, n_points=40)
    off = tuple(replace(r, active=r.active & (r.touches[0][1] != 5)) for r in records)
    rng = np.random.default_rng(3)
    constraints = [_condition(rng, unknowns, "tied", ("a", [5, 5]), ("a", [1, 11]))]
    with pytest.raises(GeometryError, match="a5"):
        adjust_large(unknowns, off, start)
    result = adjust_large(unknowns, off, start, constraints=constraints, tolerance=1e-9)
    state, Q = _solved(unknowns, off, constraints, start)
    np.testing.assert_allclose(result.state["a"], state["a"], atol=1e-8)
    c = free_columns(unknowns)["a"]
    expected = np.pad(Q, (0, 1))[c[:, :, None], c[:, None, :]]
    np.testing.assert_allclose(marginal_covariances(result).groups["a"], expected, rtol=1e-8, atol=1e-9)


def test_an_observation_of_vanishing_sigma_is_a_constraint() -> None:
    unknowns, records, start = made_problem(4, n_kept=14, n_points=40)
    condition = _condition(np.random.default_rng(5), unknowns, "tied", ("p", [5]), ("a", [1]))
    exact = adjust_large(unknowns, records, start, constraints=[condition], tolerance=1e-9)
    weighted = Records("tied", condition.touches, condition.evaluate, np.full((1, 2), 1e5), condition.active)
    observed = adjust_large(unknowns, (*records, weighted), start, tolerance=1e-9)
    assert observed.redundancy == exact.redundancy
    np.testing.assert_allclose(observed.state["a"], exact.state["a"], atol=1e-8)


def test_neither_the_size_nor_the_correlation_of_the_standard_deviations_changes_a_constraint() -> None:
    unknowns, records, start = made_problem(4, n_kept=14, n_points=40)
    condition = _condition(np.random.default_rng(5), unknowns, "tied", ("p", [5, 7]), ("a", [1, 2]))
    mixing = np.tile([[40.0, 0.0], [-7.0, 0.3]], (2, 1, 1))
    other = Records("tied", condition.touches, condition.evaluate, mixing, condition.active)
    first, second = (
        adjust_large(unknowns, records, start, constraints=[c], tolerance=1e-9) for c in (condition, other)
    )
    np.testing.assert_allclose(first.state["p"], second.state["p"], atol=1e-10)
    Q, P = (marginal_covariances(r).groups["p"] for r in (first, second))
    np.testing.assert_allclose(Q, P, rtol=1e-8, atol=1e-12)


def test_constraints_that_depend_on_each_other_are_named() -> None:
    unknowns, records, start = made_problem(4, n_kept=14, n_points=40)
    condition = _condition(np.random.default_rng(5), unknowns, "tied", ("p", [5]), ("a", [1]))
    with pytest.raises(GeometryError, match="depend on each other: tied row 0"):
        adjust_large(unknowns, records, start, constraints=[condition, condition])


def test_a_constraint_among_held_unknowns_is_refused() -> None:
    unknowns, records, start = made_problem(4, n_kept=14, n_points=40)
    condition = _condition(np.random.default_rng(5), unknowns, "idle", ("p", [7]))
    with pytest.raises(GeometryError, match="idle row 0 does not depend on any free unknown"):
        adjust_large(unknowns, records, start, constraints=[condition])


def test_a_start_far_from_the_constraints_is_brought_onto_them() -> None:
    """A point demanded on a sphere of radius 5 about another, from some other distance; the optimum is one of cost."""
    unknowns, records, start = shared_problem(6, n_kept=14, n_points=40)

    def evaluate(state, rows):
        d = state["p"][[4, 6]] - state["p"][[9, 11]]
        length = np.linalg.norm(d, axis=1)
        J = (d / length[:, None])[:, None, :]
        return (length - 5.0)[rows, None], (J[rows], -J[rows])

    sphere = Records(
        "distance 5", (("p", np.array([4, 6])), ("p", np.array([9, 11]))), evaluate, np.ones((2, 1)), np.ones(2, bool)
    )
    start = {**start, "p": np.random.default_rng(1).normal(size=start["p"].shape)}
    result = adjust_large(unknowns, records, start, constraints=[sphere], tolerance=1e-9, max_iterations=100)
    length = np.linalg.norm(result.state["p"][[4, 6]] - result.state["p"][[9, 11]], axis=1)
    np.testing.assert_allclose(length, 5.0, rtol=1e-13)
    J, v = dense_jacobian(unknowns, records, result.state)
    C, c = dense_jacobian(unknowns, [sphere], result.state)
    assert np.abs(constrained_reference(J, v, C, c)[0]).max() < 1e-6
