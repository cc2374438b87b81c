"""The end of a part's way up: what it leaves for the unknowns that it shares goes to who joins the parts.

The root of a part's tree has the shared unknowns as its boundary. Its front is the update of the part, as that of any
subtree is; it goes up with the part's cost, and the solution of the shared unknowns comes back. From there on the part
goes down its tree as ever.
"""

import numpy as np

from aatri.adjustment.elimination.factor import Factor, Factored, forward_substituted
from aatri.adjustment.elimination.panels import down_the_tree
from aatri.adjustment.others import Others, SharedEquations
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.arrays import Float, Int


def joined(
    problem: IndexedProblem, factored: Factored, front: tuple[Float, Float, Float] | None, others: Others
) -> Factored:
    """A part's factor with the joint solution.

    Parameters
    ----------
    front : tuple, or None
        Front of the part's root, its gradient and diagonal; None of a part that shares nothing.

    Raises
    ------
    NotInParts
        If unknowns are not determined.
    """
    columns = shared_columns(problem)
    F, g, d = (np.zeros((0, 0)), np.zeros(0), np.zeros(0)) if front is None else front
    free = np.flatnonzero(~problem.layout.fixed[problem.tree.nodes[-1].columns]) if front is not None else columns
    regular = not factored.weak and bool((factored.determined != 0).all())
    lower = [F[free[j:], column] for j, column in enumerate(free)]
    reply = others.joined(
        SharedEquations(
            _numbers(problem)[columns],
            np.concatenate([np.zeros(0), *lower]),
            g[free],
            d[free],
            factored.cost,
            factored.decrease,
            factored.damping,
            regular,
        )
    )
    x = forward_substituted(problem.tree, factored.y, problem.layout.n_kept)
    x[columns] = reply.x
    down_the_tree(problem.tree, factored.factor.all_panels, x[:, None])
    factored.factor = Factor(factored.factor.panels, x)
    factored.cost, factored.joint, factored.root = reply.cost, reply, front
    factored.diagonal[columns] = reply.diagonal
    return factored


def shared_columns(problem: IndexedProblem) -> Int:
    """Kept columns of the free unknowns that a part shares, in the order of its root."""
    if not problem.layout.shared.any():
        return np.zeros(0, dtype=np.int64)
    columns = problem.tree.nodes[-1].columns
    return columns[~problem.layout.fixed[columns]]


def shared_front(problem: IndexedProblem, covariance: Float) -> Float:
    """A covariance of the shared unknowns as the front of the root, zero where held."""
    if not problem.layout.shared.any():
        return np.zeros((0, 0), order="F")
    size = problem.tree.nodes[-1].size
    free = np.flatnonzero(~problem.layout.fixed[problem.tree.nodes[-1].columns])
    front = np.zeros((size, size), order="F")
    front[np.ix_(free, free)] = covariance
    return front


def _numbers(problem: IndexedProblem) -> Int:
    """What each kept column is called in all parts of a problem, (n_kept,): they have the same groups of unknowns."""
    number, first = np.full(problem.layout.n_kept, -1, dtype=np.int64), 0
    for u in problem.unknowns:
        columns = problem.layout.columns(u.name, u.size)
        number[columns[columns >= 0]] = first + np.flatnonzero(columns >= 0)
        first += u.free.size
    return number
