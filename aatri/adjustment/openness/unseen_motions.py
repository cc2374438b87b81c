"""Motions of everything together that no observation sees, for problems of any size.

With A the whitened Jacobian of all observations and G the moves of all unknowns with the generators of a similarity,
the combinations c with A G c = 0 are open, whatever the factorisation says: of the vanishing pivots of a large factor
only the first is sure, those after it are rounding. A G takes one way through the observations, and 7 x 7 numbers.
"""

from __future__ import annotations

import numpy as np

from aatri.adjustment.openness.limits import UNSEEN
from aatri.adjustment.openness.motions import ORDER, echelon, named
from aatri.adjustment.records import whitened
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.unknowns import State
from aatri.arrays import Float

CHUNK = 50_000


def unseen_motions(problem: IndexedProblem, state: State) -> list[str]:
    """Names of the motions of all unknowns together that are open.

    Parameters
    ----------
    problem : IndexedProblem
    state : State
    """
    moves: dict[str, Float] = {}
    for u in problem.unknowns:
        move = u.generator(state)[:, :, ORDER] if u.generator is not None else np.zeros((len(u.free), u.size, 7))
        moves[u.name] = np.where(u.free[:, :, None], move, 0.0)
    seen, parts = np.zeros((7, 7)), np.zeros(7)
    for r in (*problem.records, *problem.constraints):
        active = np.flatnonzero(r.active)
        for first in range(0, len(active), CHUNK):
            rows = active[first : first + CHUNK]
            _, jacobians = whitened(r, state, rows)
            each = [J @ moves[group][block[rows]] for (group, block), J in zip(r.touches, jacobians)]
            AG = np.sum(each, axis=0).reshape(-1, 7)
            seen += AG.T @ AG
            parts += sum((part**2).sum(axis=(0, 1)) for part in each)
    some = np.flatnonzero(parts > 0)
    if not len(some):
        return []
    size = np.sqrt(parts[some])
    values, vectors = np.linalg.eigh(seen[np.ix_(some, some)] / np.outer(size, size))
    motions = np.zeros((int((values < UNSEEN).sum()), 7))
    motions[:, some] = vectors.T[values < UNSEEN]
    extent = np.ones(7)
    extent[some] = size
    return [named(motion / extent, extent) for motion in echelon(motions)] if len(motions) else []
