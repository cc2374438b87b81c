"""Motions of everything together that no observation sees, for problems of any size.

With A the Jacobian of all observations, each row of length 1, and G the moves of all unknowns with the generators of a
similarity, the combinations c with A G c = 0 are open, whatever the factorisation says: of the vanishing pivots of a
large factor only the first is sure, those after it are rounding. A G takes one way through the observations, and 7 x 7
numbers.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from aatri.adjustment.openness.limits import UNSEEN
from aatri.adjustment.openness.motions import ORDER, Motion, echelon, named
from aatri.adjustment.records import Records, whitened
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.unknowns import State
from aatri.arrays import Float, Int

CHUNK = 50_000


def unseen_motions(problem: IndexedProblem, state: State) -> list[Motion]:
    """The motions of all unknowns together that are open."""
    moves = _moves_of_all(problem, state)
    still = np.sum([(move**2).sum(axis=(0, 1)) for move in moves.values()], axis=0) == 0
    unmoved = np.eye(7)[np.broadcast_to(still, 7)]  # in which nothing moves is not open
    V, extent = unseen_combinations((*problem.records, *problem.constraints), state, moves, [unmoved])
    return [named(motion / extent, extent) for motion in echelon(V.T * extent)] if V.size else []


def unseen_combinations(
    records: Sequence[Records], state: State, moves: Mapping[str, Float], fixed: Sequence[Float] = ()
) -> tuple[Float, Float]:
    """Combinations of the seven motions that nothing sees.

    Every scalar observation counts with the share of its derivatives that a motion moves it by, whatever its weight.

    Parameters
    ----------
    moves : mapping of (n, k, 7) float64
        Moves of the unknowns of each group with the seven.
    fixed : sequence of (m, 7) float64
        Moves of scalars that may not move.

    Returns
    -------
    V : (7, d) float64
        The combinations, orthonormal.
    extent : (7,) float64
        By how much each of the seven moves the parts of all observations.
    """
    seen, parts = np.concatenate([np.zeros((0, 7)), *fixed]), np.zeros(7)
    parts += (seen**2).sum(axis=0)
    for r in records:
        active = np.flatnonzero(r.active)
        for first in range(0, len(active), CHUNK):
            rows = active[first : first + CHUNK]
            _, each = _each_motion(r, state, rows, moves)
            change = _together(r, state, rows, each)
            seen = np.asarray(np.linalg.qr(np.concatenate([seen, change.reshape(-1, 7)]), mode="r"))
            parts += sum((part**2).sum(axis=(0, 1)) for part in each)
    extent = np.sqrt(np.where(parts > 0, parts, 1.0))
    _, values, vectors = np.linalg.svd(np.pad(seen, ((0, max(7 - len(seen), 0)), (0, 0))) / extent)
    return np.linalg.qr(vectors[values**2 < UNSEEN].T / extent[:, None])[0], extent


def fit_of_datum(problem: IndexedProblem, state: State) -> tuple[float, int]:
    """Fit of the observations that see any motion of the whole: the datum rests on them.

    Their redundancy is at least their number less seven, less the unknowns that they touch and no ray does.

    Returns
    -------
    sigma0 : float
        sqrt(v'v / r) of the whitened residuals v; NaN without redundancy.
    redundancy : int
        r.
    """
    moves, squares, count, touched = _moves_of_all(problem, state), 0.0, 0, set[str]()
    for r, rows in problem.beside_rays:
        active = np.unique(rows[r.active[rows]])
        v, each = _each_motion(r, state, active, moves)
        sees = (_together(r, state, active, each) ** 2).sum(axis=2)
        sees = sees > UNSEEN * np.sum([np.zeros_like(sees), *((part**2).sum(axis=2) for part in each)], axis=0)
        squares, count = squares + float((v[sees] ** 2).sum()), count + int(sees.sum())
        touched |= r.groups if sees.any() else set()
    of_rays = problem.rays.records.groups if problem.rays is not None else set[str]()
    own = sum(int(u.free.sum()) for u in problem.unknowns if u.name in touched - of_rays)
    redundancy = count - len(ORDER) - own
    return (float(np.sqrt(squares / redundancy)) if redundancy > 0 else float("nan")), redundancy


def _moves_of_all(problem: IndexedProblem, state: State) -> dict[str, Float]:
    """Moves of the free unknowns of each group with the seven motions, (n, k, 7)."""
    return {
        u.name: np.where(u.free[:, :, None], u.generator(state)[:, :, ORDER], 0.0)
        for u in problem.unknowns
        if u.generator is not None
    }


def _each_motion(r: Records, state: State, rows: Int, moves: Mapping[str, Float]) -> tuple[Float, list[Float]]:
    """Whitened residuals, and by how much the moves of each part change them, their derivatives of length 1."""
    v, jacobians = whitened(r, state, rows)
    size = np.sqrt(sum((J**2).sum(axis=2, keepdims=True) for J in jacobians))
    size = np.where(size > 0, size, 1.0)
    touches = zip(r.touches, jacobians)
    return v, [J @ moves[group][block[rows]] / size for (group, block), J in touches if group in moves]


def _together(r: Records, state: State, rows: Int, each: list[Float]) -> Float:
    """By how much the motions change observations, (n, r.rows, 7)."""
    change = np.sum([np.zeros((len(rows), r.rows, 7)), *each], axis=0)
    return np.asarray(change if r.similarity is None else change @ r.similarity(state, rows))
