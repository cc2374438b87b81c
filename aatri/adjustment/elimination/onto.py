"""Normal equations reduced onto chosen unknowns: all others are eliminated, front by front, the last of them at once.

    N = N11 - N12 N22^-1 N21,    g = g1 - N12 N22^-1 g2,    v'v = c - g2' N22^-1 g2

Source: Helmert 1880; Wolf 1978, The Helmert block method.
"""

import numpy as np
from scipy.linalg import LinAlgError, cho_solve, cholesky

from aatri.adjustment.elimination.fronts import Work
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.unknowns import State
from aatri.arrays import Float, Int
from aatri.errors import GeometryError


def reduced_onto(problem: IndexedProblem, state: State, chosen: Int) -> tuple[Float, Float, float]:
    """Normal equations N d + g = 0 of chosen unknowns at a state.

    Parameters
    ----------
    problem : IndexedProblem
        Ordered by nested dissection, the chosen unknowns without a position: they lie in the last front.
    state : State
    chosen : (n,) int
        Kept columns, none of them held.

    Returns
    -------
    N : (n, n) float64
    g : (n,) float64
        Half the gradient.
    cost : float
        v'v at the chosen unknowns as they are, and all others at their best by the linear model.

    Raises
    ------
    GeometryError
        If others are not determined where the chosen ones are known.
    """
    work, last = Work(problem, state, 0.0), len(problem.tree.nodes) - 1
    work.run(range(last))
    work.assemble(last)
    F, gradient, _ = work.gather(last)
    columns = problem.tree.nodes[last].columns
    place = np.full(problem.layout.n_kept, -1)
    place[columns] = np.arange(len(columns))
    own = place[chosen]
    other = np.setdiff1d(np.flatnonzero(~problem.layout.held[columns]), own)
    if any(weak >= 0 for weak in work.weak[:last]) or (own < 0).any():
        raise _undetermined()
    N = np.tril(F) + np.tril(F, -1).T
    cost = float(work.cost.sum() - sum(y @ y for y in work.y[:last]) - (work.block_y**2).sum())
    reduced, right, fall = without(N, gradient, own, other)
    return reduced, right, cost - fall


def without(N: Float, g: Float, own: Int, other: Int) -> tuple[Float, Float, float]:
    """Some unknowns eliminated from dense normal equations.

    Parameters
    ----------
    N : (n, n) float64
    g : (n,) float64
    own, other : int
        Unknowns that stay, and that go.

    Returns
    -------
    N, g
        Of those that stay.
    fall : float
        By how much v'v falls.
    """
    if not len(other):
        return N[np.ix_(own, own)], g[own], 0.0
    try:
        L = cholesky(N[np.ix_(other, other)], lower=True)
    except LinAlgError as error:
        raise _undetermined() from error
    between = N[np.ix_(other, own)]
    best = cho_solve((L, True), g[other])
    reduced = N[np.ix_(own, own)] - between.T @ cho_solve((L, True), between)
    return 0.5 * (reduced + reduced.T), g[own] - between.T @ best, float(g[other] @ best)


def _undetermined() -> GeometryError:
    return GeometryError(
        "unknowns that are to be eliminated are not determined by their observations and those that are kept",
        remedy="adjust the block first; keep what its own observations do not determine",
    )
