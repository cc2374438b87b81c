"""The reduced normal equations of the kept unknowns as one dense matrix, before any factorisation.

What the eliminated blocks leave, N = A'A - sum Y Y' and g, in the layout's columns: for problems of few kept unknowns,
to look at as a whole.
"""

from dataclasses import dataclass

import numpy as np

from aatri.adjustment.elimination.fronts import Work
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.unknowns import State
from aatri.arrays import Float


@dataclass(frozen=True)
class ReducedNormals:
    """Normal matrix of the kept unknowns at a state."""

    N: Float
    """(n_kept, n_kept). Zero rows and columns where held."""
    diagonal: Float
    """(n_kept,). Diagonal of A'A, before elimination."""


def reduced_normals(problem: IndexedProblem, state: State) -> ReducedNormals:
    """Linearise at a state, eliminate the blocks, and add up what they leave."""
    work, n = Work(problem, state, 0.0), problem.layout.n_kept
    N, diagonal = np.zeros((n, n)), np.zeros(n)
    for k, node in enumerate(problem.tree.nodes):
        work.assemble(k)
        front = work.fronts[k]
        assert front is not None
        F, _, d = front
        N[np.ix_(node.columns, node.columns)] += np.tril(F) + np.tril(F, -1).T
        diagonal[node.columns] += d
        work.room.give(F)
        work.fronts[k] = None
    return ReducedNormals(N, diagonal)
