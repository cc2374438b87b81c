"""What to do about what a solution leaves nearly open (`conditioning`): refuse it by name, or set blocks aside."""

from __future__ import annotations

import numpy as np

from aatri.adjustment.conditioning import conditioning, notes_of, refuse_open
from aatri.adjustment.constraints import factorise_constrained
from aatri.adjustment.diagnosis import refuse_undetermined
from aatri.adjustment.structure.indexed_problem import Factored, IndexedProblem
from aatri.adjustment.structure.weights import with_set_aside
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Int
from aatri.errors import GeometryError
from aatri.notes import Note

Blocks = dict[str, Bool]
"""Some blocks by group, (n,) each."""


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
    refuse_open(found)
    weak: Blocks = {}
    for u in problem.unknowns:
        some = np.isin(problem.layout.vertex[u.name], found.weak_vertices) & u.free.any(axis=1)
        if u.eliminated:
            some |= _of_rays(problem, found.weak_blocks)
        if some.any():
            weak[u.name] = some
    return weak, list(notes_of(found))


def without_weak_blocks(
    problem: IndexedProblem, state: State, weak: Blocks
) -> tuple[IndexedProblem, Factored, list[Note]]:
    """The problem with weak blocks set aside, and those eliminated ones that are open without them; factorised."""
    notes = [_note(problem, weak, "set aside, its observations hardly determine it")]
    problem = with_set_aside(problem, weak)
    factored = factorise_constrained(problem, state)
    lost = np.flatnonzero(factored.determined == 0)
    if len(lost):
        blocks = {problem.layout.eliminated: _of_rays(problem, lost)}
        notes.append(_note(problem, blocks, "set aside, what is left of its observations does not determine it"))
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
