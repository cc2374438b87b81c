"""What to do about what a solution leaves nearly open (`conditioning`): refuse it by name, or set blocks aside."""

from __future__ import annotations

import numpy as np

from aatri.adjustment.conditioning import conditioning, notes_of, refuse_open
from aatri.adjustment.constraints import factorise_constrained
from aatri.adjustment.diagnosis import null_vectors, refuse_undetermined
from aatri.adjustment.open_whole import open_motions_of_all
from aatri.adjustment.structure.indexed_problem import Factored, IndexedProblem
from aatri.adjustment.structure.weights import with_set_aside
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int
from aatri.errors import GeometryError
from aatri.notes import Note

Blocks = dict[str, Bool]
"""Some blocks by group, (n,) each."""

SET_ASIDE = "set aside, "
"""How the notes of what is set aside begin."""

MOVES = 1e-4
"""Share of the largest, squared, from which on a vertex takes part in an open direction."""

MOST_PARTS = 20
"""So many loose parts are set aside at most, one after the other."""


def without_open_parts(
    problem: IndexedProblem, state: State, factored: Factored
) -> tuple[IndexedProblem, Factored, list[Note]]:
    """The problem without what its observations leave open at the start, as long as that is not all of it."""
    notes: list[Note] = []
    for _ in range(MOST_PARTS):
        lost: Blocks = {}
        if (factored.determined == 0).any() and (factored.determined != 0).any():
            lost = {problem.layout.eliminated: _of_rays(problem, np.flatnonzero(factored.determined == 0))}
        elif factored.weak and factored.factor.whole:
            lost = loose_part(problem, state, null_vectors(problem, state, factored)[1])
        if not lost:
            break
        notes.append(_note(problem, lost, f"{SET_ASIDE}its observations do not determine it"))
        problem = with_set_aside(problem, lost)
        factored = factorise_constrained(problem, state)
    return problem, factored, notes


def loose_part(problem: IndexedProblem, state: State, directions: Float) -> Blocks:
    """What moves in open directions, where something else stays that is determined; else nothing.

    A camera or a parameter that many share is no part: without it all would change. Nor is a whole block whose datum is
    open, of which a point may stay where it is.

    Parameters
    ----------
    directions : (n_kept, k) float64
        Open directions in unknowns times the root of their diagonal, orthonormal.
    """
    size = problem.layout.size
    vertex = np.repeat(np.arange(len(size)), size)
    share = np.bincount(vertex, (directions**2).sum(axis=1), minlength=len(size))
    moving = share > MOVES * share.max(initial=0.0)
    part: Blocks = {}
    stays = np.zeros(len(size), dtype=bool)
    bodies = np.zeros(len(size), dtype=bool)
    for u in problem.unknowns:
        at = problem.layout.vertex[u.name]
        free = (at >= 0) & u.free.any(axis=1)
        if u.generator is not None:
            bodies[at[free]] = True
            stays[at[free & ~moving[at]]] |= not u.eliminated
        if (free & moving[at]).any():
            part[u.name] = free & moving[at]
    if not part or not stays.any() or (moving & ~bodies).any() or open_motions_of_all(problem, state):
        return {}
    return part


def weak_blocks_of(problem: IndexedProblem, state: State, factored: Factored) -> tuple[Blocks, list[Note]]:
    """Single blocks that are open, and warnings of what nearly is.

    Raises
    ------
    GeometryError
        If combinations of several blocks are open.
    """
    if not factored.factor.whole:
        return {}, []
    found = conditioning(problem, factored, state)
    weak = loose_part(problem, state, found.directions) if found.open else {}
    if not weak:
        refuse_open(found)
    for u in problem.unknowns:
        some = np.isin(problem.layout.vertex[u.name], found.weak_vertices) & u.free.any(axis=1)
        if u.eliminated:
            some |= _of_rays(problem, found.weak_blocks)
        if some.any():
            weak[u.name] = weak[u.name] | some if u.name in weak else some
    return weak, list(notes_of(found))


def without_weak_blocks(
    problem: IndexedProblem, state: State, weak: Blocks
) -> tuple[IndexedProblem, Factored, list[Note]]:
    """The problem with weak blocks set aside, and those eliminated ones that are open without them; factorised."""
    notes = [_note(problem, weak, f"{SET_ASIDE}its observations hardly determine it")]
    problem = with_set_aside(problem, weak)
    factored = factorise_constrained(problem, state)
    lost = np.flatnonzero(factored.determined == 0)
    if len(lost):
        blocks = {problem.layout.eliminated: _of_rays(problem, lost)}
        notes.append(_note(problem, blocks, f"{SET_ASIDE}what is left of its observations does not determine it"))
        problem = with_set_aside(problem, blocks)
        factored = factorise_constrained(problem, state)
    return problem, factored, notes


def refuse_nearly_singular(problem: IndexedProblem, state: State, iterations: int) -> None:
    """Raise if a problem that did not converge is singular, or within a factor of ten of the limits.

    Raises
    ------
    GeometryError
    """
    factored = factorise_constrained(problem, state)
    if not factored.factor.whole or not np.isfinite(factored.cost) or (factored.determined == 0).any():
        return
    if factored.weak:
        refuse_undetermined(problem, state, factored)
    found = conditioning(problem, factored, state)
    alone = [f"{u.name} {u.ids[int(k)]}" for u in problem.unknowns
             for k in np.flatnonzero(np.isin(problem.layout.vertex[u.name], found.weak_vertices))]  # fmt: skip
    texts = (*found.open, *alone, *found.nearly)
    if texts:
        raise GeometryError(
            f"no convergence in {iterations} iterations: the observations nearly leave {len(texts)} combination(s) of "
            f"unknowns open: {'; '.join(texts[:7])}",
            remedy="observe more, hold them or weigh them by a prior, or estimate fewer parameters",
        )


def _note(problem: IndexedProblem, blocks: Blocks, text: str) -> Note:
    groups = [(u.name, u.ids, blocks[u.name]) for u in problem.unknowns if u.name in blocks]
    ids = [f"{name} {one}" for name, of, some in groups for one, out in zip(of, some) if out]
    return Note("warning", text, tuple(ids))


def _of_rays(problem: IndexedProblem, places: Int) -> Bool:
    """Which blocks of the eliminated group stand at some places among the rays' blocks."""
    found = np.zeros(len(problem.layout.block), dtype=bool)
    if problem.rays is not None:
        found[problem.rays.block[places]] = True
    return found
