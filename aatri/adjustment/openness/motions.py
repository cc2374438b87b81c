"""Open directions that are motions of a whole: shift, rotation and change of scale of the block, or of a part of it.

A defect of the datum is spread over all unknowns, and a list of the largest names none of it. Columns G_k say how the
unknowns move with the seven generators of a similarity (`Unknowns.generator`). Of every part that nothing joins to
the rest, the combinations G_k c that lie in the span of the null vectors are motions; the coefficients c, brought to
echelon form (scale and rotations before shifts), name them. What is left of the null vectors is something else.

Source: docs/formulas.md 7 (generators of the datum); Golub & Van Loan, Matrix Computations, 6.4.3 (common subspaces).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from aatri.adjustment.openness.limits import INDEPENDENT, MOTION_IF_OPEN, NAMED, NAMED_PART, SMALL_PART, WHOLE_SHARE
from aatri.adjustment.openness.open_directions import Move, OpenCombination
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int

NAMES = ("scale", "rotation about X", "rotation about Y", "rotation about Z", "shift X", "shift Y", "shift Z")

WHOLE_BLOCK = "the whole block"

ORDER = np.array([6, 3, 4, 5, 0, 1, 2])
"""The columns of a generator (three shifts, three rotations, scale) in the order of `NAMES`."""


def open_motions(
    problem: IndexedProblem,
    state: State,
    vectors: Float,
    diagonal: Float,
    normals: Float | None = None,
    common: float = MOTION_IF_OPEN,
) -> tuple[list[OpenCombination], Float]:
    """The motions among open directions, by name, and what is left.

    Parameters
    ----------
    vectors : (n_kept, k) float64
        Open directions in unknowns times sqrt(diagonal).
    diagonal : (n_kept,) float64
        Of the normal matrix.
    normals : (n_kept, n_kept) float64, optional
        The normal matrix: what it does not join are parts by themselves.
    common : float
        Cosine from which on a motion counts as one of the directions.

    Returns
    -------
    (n_kept, m) float64
        Open directions that are no motions, orthonormal.
    """
    moves = _moves(problem, state) * np.sqrt(np.maximum(diagonal, 0.0))[:, None]
    going_along = ~(moves != 0).any(axis=1) & ~_of_rays(problem)
    combinations: list[OpenCombination] = []
    left = []
    for part in _parts(problem, normals):
        open_here = _orthonormal(np.where(part[:, None], vectors, 0.0))
        vertex = np.repeat(np.arange(len(problem.layout.size)), problem.layout.size)  # whose unknowns go together
        takes_part = np.asarray(np.bincount(vertex, _taking_part(open_here), len(problem.layout.size))[vertex] > 0)
        coefficients, directions = _common(moves * takes_part[:, None], open_here, going_along, common)
        if len(coefficients):
            extent = np.linalg.norm(moves, axis=0)
            motions = [named(row, extent) for row in coefficients]
            along, unknowns = _along(problem, np.where(going_along[:, None], directions, 0.0))
            subject = _whole_or_part(problem, open_here, moves @ coefficients.T)
            combinations.append(of_motions(motions, subject, along, unknowns))
        left.append(_without(open_here, directions))
    return combinations, np.concatenate(left, axis=1) if combinations else vectors


def _moves(problem: IndexedProblem, state: State) -> Float:
    """Moves of the kept unknowns with each generator, in the order of NAMES, (n_kept, 7).

    Generators that move the held scalars of blocks (heights of a plane network) more than the free ones are no motions.
    """
    moves, of_held = np.zeros((problem.layout.n_kept, 7)), np.zeros(7)
    for u in problem.unknowns:
        columns = problem.layout.columns(u.name, u.size)  # -1 where held
        if u.generator is None or not (columns >= 0).any():
            continue
        move = u.generator(state)[:, :, ORDER]
        moves[columns[columns >= 0]] = move[columns >= 0]
        partly = (columns >= 0).any(axis=1, keepdims=True)
        of_held += (move[(columns < 0) & partly] ** 2).sum(axis=0)
    return np.where(of_held > (moves**2).sum(axis=0), 0.0, moves)


def _parts(problem: IndexedProblem, normals: Float | None) -> list[Bool]:
    """Kept unknowns of every part that nothing joins to the others, (n_kept,) bool each."""
    free = ~problem.layout.fixed
    if normals is None:
        return [free]
    number = connected_components(csr_array(normals != 0), directed=False)[1]
    return [free & (number == k) for k in np.unique(number[free])]


def _taking_part(vectors: Float) -> Bool:
    size = np.linalg.norm(vectors, axis=1)
    return np.asarray(size > SMALL_PART * size.max(initial=0.0))


def _of_rays(problem: IndexedProblem) -> Bool:
    """Kept unknowns that rays touch: with one of those that no motion moves, poses move otherwise than their points."""
    of_rays = np.zeros(problem.layout.n_kept, dtype=bool)
    touched = problem.rays.records.groups if problem.rays is not None else set[str]()
    for u in problem.unknowns:
        if u.name in touched:
            columns = problem.layout.columns(u.name, u.size)
            of_rays[columns[columns >= 0]] = True
    return of_rays


def _common(moves: Float, vectors: Float, going_along: Bool, least: float) -> tuple[Float, Float]:
    """Motions in the span of orthonormal vectors: coefficients in echelon form (m, 7), and the directions they are.

    Unknowns that take up a motion without being moved by it (a boresight, a shift of all positions) are not compared.
    Where no more unknowns move than there are independent motions, any direction is in their span: none is reported.
    """
    none = np.zeros((0, 7)), np.zeros((len(moves), 0))
    size = np.linalg.norm(moves, axis=0)
    unit = moves / np.where(size > 0, size, 1.0)
    U, s, Wt = np.linalg.svd(unit, full_matrices=False)
    kept = s > 1e-6 * max(float(s.max(initial=0.0)), 1e-300)
    if not vectors.shape[1] or (moves != 0).any(axis=1).sum() <= kept.sum():
        return none
    movable = np.where(going_along[:, None], 0.0, vectors)
    _, cosines, Zt = np.linalg.svd(_orthonormal(movable).T @ U[:, kept], full_matrices=True)
    shared = Zt[: len(cosines)][cosines > least]
    if not len(shared):
        return none
    coefficients = echelon((shared / s[kept]) @ Wt[kept])
    motions = unit @ coefficients.T
    return coefficients / np.where(size > 0, size, 1.0), vectors @ np.linalg.lstsq(movable, motions, rcond=1e-6)[0]


def _without(vectors: Float, directions: Float) -> Float:
    """What is left of the span of orthonormal vectors, as many fewer as there are directions."""
    if not directions.shape[1]:
        return vectors
    U = np.linalg.svd(vectors.T @ directions, full_matrices=True)[0]
    return np.asarray(vectors @ U[:, directions.shape[1] :])


def _along(problem: IndexedProblem, directions: Float) -> tuple[str, tuple[tuple[str, str], ...]]:
    """What goes along with motions without being moved by them: in words, and by label and group."""
    size = np.abs(directions).max(axis=1, initial=0.0)
    names, unknowns = [], []
    for u in problem.unknowns:
        columns = problem.layout.columns(u.name, u.size)
        own = np.where(columns >= 0, size[np.maximum(columns, 0)], 0.0)
        for k, j in np.argwhere(own > NAMED * max(size.max(), 1e-9))[:4].tolist():
            names.append(u.label(k, j))
            unknowns.append((u.labels[j], u.name))
    return f" with {' with '.join(names)}" if names else "", tuple(unknowns)


def _orthonormal(vectors: Float) -> Float:
    """An orthonormal basis of what columns of about unit length span."""
    if not vectors.shape[1]:
        return vectors
    U, s, _ = np.linalg.svd(vectors, full_matrices=False)
    return np.asarray(U[:, s > INDEPENDENT])


def echelon(rows: Float) -> Float:
    """Reduced row echelon form; the columns first in order lead."""
    reduced, lead = rows.copy(), 0
    for column in range(reduced.shape[1]):
        if lead == len(reduced):
            break
        best = lead + int(np.argmax(np.abs(reduced[lead:, column])))
        if abs(reduced[best, column]) < NAMED_PART * np.abs(reduced).max():
            continue
        reduced[[lead, best]] = reduced[[best, lead]]
        reduced[lead] /= reduced[lead, column]
        others = np.arange(len(reduced)) != lead
        reduced[others] -= reduced[others, column][:, None] * reduced[lead]
        lead += 1
    return reduced


@dataclass(frozen=True)
class Motion:
    """A motion of a whole: its name, and what it does."""

    name: str
    moves: frozenset[Move]


def of_motions(
    motions: Sequence[Motion], of: str = WHOLE_BLOCK, along: str = "", unknowns: tuple[tuple[str, str], ...] = ()
) -> OpenCombination:
    """Motions of the whole block or of a part in one, with what goes along with them."""
    names = dict.fromkeys(motion.name for motion in motions)
    moves = frozenset[Move]().union(*(motion.moves for motion in motions))
    return OpenCombination(f"{', '.join(names)} of {of}{along}", moves, of == WHOLE_BLOCK, unknowns)


def named(row: Float, extent: Float) -> Motion:
    """The name of a motion: its scale and its rotation; its shift only where it has neither.

    With a change of scale or a rotation the shift depends on the centre, which is arbitrary. `extent` is by how much
    each generator moves all unknowns together.
    """
    size = np.abs(row * extent) / np.linalg.norm(row * extent)
    axis = row[1:4] / max(float(np.linalg.norm(row[1:4])), 1e-300)
    words: dict[str, Move] = {"scale": "scale"} if size[0] > NAMED_PART else {}
    if (size[1:4] > NAMED_PART).any():
        along = int(np.argmax(np.abs(axis)))
        main = abs(axis[along]) > 1.0 - 1e-4
        about = NAMES[1 + along] if main else "rotation about the axis ({:.2f}, {:.2f}, {:.2f})".format(*axis)
        words[about] = "azimuth" if main and along == 2 else "tilt"
    words = words or {NAMES[4 + k]: "shift" for k in np.flatnonzero(size[4:] > NAMED_PART)}
    return Motion(" with ".join(words), frozenset(words.values()))


def _whole_or_part(problem: IndexedProblem, vectors: Float, moves: Float) -> str:
    """`WHOLE_BLOCK` if the vectors are open for nearly all that the motion moves, else the names of the part."""
    part = _taking_part(vectors)
    energy = (moves**2).sum(axis=1)
    if energy[part].sum() > WHOLE_SHARE * energy.sum():
        return WHOLE_BLOCK
    subjects: list[str] = []
    for u in problem.unknowns:
        columns = problem.layout.columns(u.name, u.size)
        of_part: Int = np.flatnonzero(((columns >= 0) & part[np.maximum(columns, 0)]).any(axis=1))
        if len(of_part) and u.generator is not None:
            ids = [str(u.ids[k]) for k in of_part[:5]]
            subjects.append(
                f"{u.name} {', '.join(ids)}" + (f" and {len(of_part) - 5} more" if len(of_part) > 5 else "")
            )
    return f"a part that nothing holds to the rest ({'; '.join(subjects)})"
