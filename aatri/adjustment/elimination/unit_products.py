"""What the kept unknowns take up of further parameters of many units, in one pass up the tree.

With the factor N = L L' of the reduced normal equations, sparse right-hand sides c of each unit and the gradient
g = A'v of the kept unknowns,

    U = L^-1 c,    y = L^-1 g,    c'N^-1 c = U'U,    c'N^-1 g = U'y        unit by unit

A front meets the units that touch its own unknowns or those below it, and passes on what is left of their right-hand
sides at its boundary. Each panel is read once, for all units together, and no U of all kept unknowns is in memory.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from aatri.adjustment.elimination import lapack
from aatri.adjustment.elimination.factor import Factored
from aatri.adjustment.elimination.schedule import Schedule
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.arrays import Float, Int


@dataclass(frozen=True)
class _Passed:
    """What a node passes on to its parent."""

    units: Int
    """(a,) int64, ascending. Those that it has met."""
    boundary: Float
    """(boundary, a k). What is left of their right-hand sides."""
    squares: Float
    products: Float
    """(a, k, k), (a, k). U'U and U'y of the node and of those below it."""


def unit_products(problem: IndexedProblem, factored: Factored, right: csr_array, k: int) -> tuple[Float, Float]:
    """U'U and U'y of each unit.

    Parameters
    ----------
    right : (n_kept, u k) csr_array
        Right-hand sides, the k of a unit beside each other; zero for held scalars.
    k : int
        Parameters of a unit.

    Returns
    -------
    squares, products : (u, k, k), (u, k) float64
        Summed in the order of the tree: the same bits for any number of threads, as far as BLAS gives them.
    """
    nodes, n = problem.tree.nodes, right.shape[1] // k
    passed: list[_Passed | None] = [None] * len(nodes)

    def finish(node: int) -> None:
        passed[node] = _at_node(problem, factored, right, k, node, passed)
        for child in nodes[node].children:
            passed[child] = None

    Schedule.of(problem).up(_nothing, finish)
    squares, products = np.zeros((n, k, k)), np.zeros((n, k))
    for last in passed:  # those of the roots
        if last is not None:
            squares[last.units] += last.squares
            products[last.units] += last.products
    return squares, products


def _nothing(_node: int, _pool: ThreadPoolExecutor | None) -> None:
    """There is nothing to assemble but what a node finds in the right-hand sides."""


def _at_node(
    problem: IndexedProblem, factored: Factored, right: csr_array, k: int, node: int, passed: list[_Passed | None]
) -> _Passed | None:
    front, maps = problem.tree.nodes[node], problem.tree.maps
    m = front.panel
    own = right[front.columns[:m]]
    below = [(maps[child], part) for child in front.children if (part := passed[child]) is not None]
    units = np.unique(np.concatenate([own.indices // k, *(part.units for _, part in below)])).astype(np.int64)
    if not len(units):
        return None
    x = np.zeros((front.size, len(units) * k), order="F")
    row = np.repeat(np.arange(m), np.diff(own.indptr))
    x[row, np.searchsorted(units, own.indices // k) * k + own.indices % k] = own.data
    squares, products = np.zeros((len(units), k, k)), np.zeros((len(units), k))
    for rows, part in below:
        at = np.searchsorted(units, part.units)
        x[np.ix_(rows, (at[:, None] * k + np.arange(k)).ravel())] += part.boundary
        squares[at] += part.squares
        products[at] += part.products
    if m:
        lapack.forward_columns(factored.factor.panel(node), x)
        U = x[:m].reshape(m, len(units), k).transpose(1, 2, 0)
        squares += U @ U.swapaxes(1, 2)
        products += U @ factored.y[node]
    return _Passed(units, x[m:].copy(), squares, products)  # without U
