"""Normal equations reduced onto chosen unknowns: all others are eliminated, front by front, the last of them at once.

    N = N11 - N12 N22^-1 N21,    g = g1 - N12 N22^-1 g2,    v'v = c - g2' N22^-1 g2

Source: Helmert 1880; Wolf 1978, The Helmert block method.
"""

import numpy as np
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dpstrf

from aatri.adjustment.elimination.fronts import Work
from aatri.adjustment.kernels.eliminate import RANK_TOLERANCE
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
    other = np.setdiff1d(np.flatnonzero(~problem.layout.fixed[columns]), own)
    if any(weak >= 0 for weak in work.weak[:last]) or (own < 0).any():
        raise _undetermined()
    N = np.tril(F) + np.tril(F, -1).T
    cost = float(work.cost.sum() - sum(y @ y for y in work.y[:last]) - (work.block_y**2).sum())
    reduced, right, fall, rank = without(N, gradient, own, other)
    if rank < len(other):
        raise _undetermined()
    return reduced, right, cost - fall


def without(N: Float, g: Float, own: Int, other: Int) -> tuple[Float, Float, float, int]:
    """Some unknowns eliminated from dense normal equations, which may be singular.

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
    rank : int
        How many independent unknowns were eliminated.
    """
    if not len(other):
        return N[np.ix_(own, own)], g[own], 0.0, 0
    L, order, scale = pivoted_cholesky(N[np.ix_(other, other)], RANK_TOLERANCE)
    rank = L.shape[1]
    first = order[:rank]  # what is left of the others is zero, and of what ties them to those that stay
    lower, right = L[:rank], np.column_stack([N[np.ix_(other[first], own)], g[other[first]]]) / scale[first, None]
    Y = solve_triangular(lower, right, lower=True)
    reduced = N[np.ix_(own, own)] - Y[:, :-1].T @ Y[:, :-1]
    return 0.5 * (reduced + reduced.T), g[own] - Y[:, :-1].T @ Y[:, -1], float(Y[:, -1] @ Y[:, -1]), rank


def rank_of(N: Float) -> int:
    """How many unknowns of normal equations are determined, which were reduced before."""
    return int(pivoted_cholesky(N, RANK_TOLERANCE)[0].shape[1])


def pivoted_cholesky(N: Float, tolerance: float = -1.0) -> tuple[Float, Int, Float]:
    """Cholesky factor of a positive semidefinite matrix, its largest pivots first: S^-1 N S^-1 = L L' in that order.

    Parameters
    ----------
    N : (n, n) float64
    tolerance : float
        Pivots below it are zero, the diagonal being 1; negative: n times the rounding error.

    Returns
    -------
    L : (n, rank) float64
        Lower trapezoid, in the order of the pivots.
    order : (n,) int
        The row of N of each row of L.
    scale : (n,) float64
        S, roots of the diagonal of N.

    Source: Higham 2002, Accuracy and stability of numerical algorithms, 10.3.
    """
    diagonal = np.diagonal(N)
    scale = np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    factor, order, rank, _ = dpstrf(N / scale[:, None] / scale, lower=1, tol=tolerance)
    return np.tril(factor)[:, :rank], order.astype(np.int64) - 1, scale


def _undetermined() -> GeometryError:
    return GeometryError(
        "unknowns that are to be eliminated are not determined by their observations and those that are kept",
        remedy="adjust the block first; keep what its own observations do not determine",
    )
