"""What the kept unknowns take up of many units, against the dense inverse and the solved step."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_array

from aatri.adjustment.constraints.multipliers import factorise_constrained
from aatri.adjustment.elimination import schedule
from aatri.adjustment.elimination.effects import unit_products
from aatri.adjustment.elimination.reduced import reduced_normals
from aatri.adjustment.stepping.adjust import adjust_large
from tests.adjustment.block_problem import made_problem

UNITS, K = 20, 3


def factored_start(threads: int = 1):
    """A block with room for several subtrees, factorised away from its solution; sides of units on few unknowns."""
    unknowns, records, start = made_problem(4, n_kept=200, n_points=500)
    problem = adjust_large(unknowns, records, start, threads=threads).problem
    rng, n = np.random.default_rng(4), problem.layout.n_kept
    right = np.zeros((n, UNITS, K))
    for unit in range(1, UNITS):  # the first has none
        rows = rng.integers(0, n, unit)
        right[rows, unit] = rng.normal(size=(len(rows), K))
    right[problem.layout.fixed] = 0.0
    return problem, start, factorise_constrained(problem, start), right


def test_squares_and_products_are_those_of_the_dense_inverse_and_of_the_step() -> None:
    problem, start, factored, right = factored_start()
    N = reduced_normals(problem, start).N
    held = problem.layout.fixed
    N[held, held] = 1.0
    Q, n = np.linalg.inv(N), len(right)
    step = factored.factor.solution(problem.tree, factored.y, n)
    squares, products = unit_products(problem, factored, csr_array(right.reshape(n, -1)), K)
    for unit in range(UNITS):
        c = right[:, unit]
        assert np.allclose(squares[unit], c.T @ Q @ c, rtol=1e-10, atol=1e-12)
        assert np.allclose(products[unit], c.T @ step, rtol=1e-10, atol=1e-12)


def test_threads_do_not_change_a_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(schedule, "PARALLEL_FLOPS", 0.0)
    one, other = (factored_start(threads) for threads in (1, 3))
    assert len(schedule.Schedule.of(other[0]).subtrees) > 1
    results = [
        unit_products(problem, one[2], csr_array(one[3].reshape(len(one[3]), -1)), K) for problem in (one[0], other[0])
    ]
    for first, second in zip(*results):
        np.testing.assert_array_equal(first, second)
