"""What to do about what is open: refuse it by name, or set blocks aside."""

from dataclasses import replace

import numpy as np

from aatri.adjustment.constraints.multipliers import factorise_constrained
from aatri.adjustment.elimination.factor import LOST, Factored
from aatri.adjustment.openness.limits import MOST_NAMED, MOST_PARTS, MOVES
from aatri.adjustment.openness.nearly_open import loosely_held, nearly_open
from aatri.adjustment.openness.null_vectors import vanishing
from aatri.adjustment.openness.open_directions import OpenCombination, OpenDirections, OpenError, described
from aatri.adjustment.openness.unseen_motions import unseen_motions
from aatri.adjustment.openness.weighted_datum import are_seen_motions, is_singular
from aatri.adjustment.others import NotInParts
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.structure.weights import with_set_aside
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float, Int
from aatri.errors import GeometryError
from aatri.notes import Note

Blocks = dict[str, Bool]
"""Some blocks by group, (n,) each."""


def without_open_parts(
    problem: IndexedProblem, state: State, factored: Factored, reason: str = "its observations do not determine it"
) -> tuple[IndexedProblem, Factored, list[Note]]:
    """The problem without what vanishing pivots leave open, as long as that is not all of it."""
    notes: list[Note] = []
    for _ in range(MOST_PARTS):
        if not (factored.factor.is_direct or (factored.determined == 0).any()):
            break
        if not is_singular(problem, state, factored):
            break
        blocks = _undetermined(problem, state, vanishing(problem, state, factored))
        if not blocks:
            break
        notes.append(_note(problem, blocks, reason))
        problem = with_set_aside(problem, blocks)
        factored = factorise_constrained(problem, state)
    return problem, factored, notes


def without_weak_parts(
    problem: IndexedProblem, state: State, factored: Factored
) -> tuple[IndexedProblem, Factored, list[Note]] | list[Note]:
    """The problem without what rounding hides from the pivots, factorised; or else warnings of what is nearly open.

    Raises
    ------
    GeometryError
        If combinations of several blocks are open.
    """
    if not factored.factor.is_direct:
        return []
    others = problem.settings.others
    if factored.joint is not None and others is not None:
        factored.joint = replace(factored.joint, covariance=others.shared_covariance())
        weak = nearly_open(problem, factored, state)
        if others.first("open" if weak.texts or len(weak.vertices) or len(weak.blocks) else ""):
            raise NotInParts("unknowns are nearly open")
        return weak.notes()
    weak = nearly_open(problem, factored, state)
    blocks = _undetermined(problem, state, weak)
    if not blocks:
        weak = loosely_held(problem, factored, state, weak)
        weak.refuse()
        return weak.notes()
    notes = [*weak.notes(), _note(problem, blocks, "its observations hardly determine it")]
    problem = with_set_aside(problem, blocks)
    factored = factorise_constrained(problem, state)
    reason = "what is left of its observations does not determine it"
    problem, factored, more = without_open_parts(problem, state, factored, reason)
    return problem, factored, [*notes, *more]


def refuse_undetermined(problem: IndexedProblem, state: State, factored: Factored) -> None:
    """Raise the error that names what vanishing pivots leave open.

    Raises
    ------
    OpenError
        If combinations of unknowns are open, or so little determined that rounding leaves nothing of them.
    GeometryError
        If points are not determined.
    """
    open_ = vanishing(problem, state, factored)
    if factored.lost and are_seen_motions(problem, state, open_.texts):
        named = "; ".join(map(str, open_.texts))
        raise OpenError(
            f"rounding leaves nothing of {named}: the observations that determine it have less than {LOST:.0e} of the "
            "weight of all others",
            remedy="state smaller standard deviations of control and positions, if they are better than stated, or "
            "larger ones of the image points; if both are right, look for control or images with each other's id",
        )
    open_.refuse()
    group, rays = next(u for u in problem.unknowns if u.eliminated), problem.rays
    names = [] if rays is None else [f"{group.name} {group.ids[k]}" for k in np.sort(rays.block[open_.blocks])]
    more = f" and {len(names) - 10} more" if len(names) > 10 else ""
    raise GeometryError(
        f"{len(names)} of {len(group.ids)} are not determined by their observations: {', '.join(names[:10])}{more}",
        remedy="give them more rays or known coordinates, or leave them out",
    )


def refuse_singular(problem: IndexedProblem, state: State) -> None:
    """Raise if a problem that has no factor is singular at a state.

    Raises
    ------
    GeometryError
        The message names unknowns of a null vector.
    """
    from aatri.adjustment.iterative.conjugate_gradients import null_vector  # compiled only where it is needed

    vector = null_vector(problem, state)
    if vector is not None:
        combination = described(problem, vector)
        raise OpenError(f"the observations leave unknowns open: {combination}", remedy="", combinations=[combination])


def refuse_nearly_singular(problem: IndexedProblem, state: State, iterations: int, falling: str = "") -> None:
    """Raise if a problem that did not converge is singular, or within a factor of ten of the limits.

    Parameters
    ----------
    falling : str
        What there is to say where it might yet converge.

    Raises
    ------
    GeometryError
    """
    factored = factorise_constrained(problem, state)
    if not factored.factor.is_direct or not np.isfinite(factored.cost) or (factored.determined == 0).any():
        return
    if is_singular(problem, state, factored):
        refuse_undetermined(problem, state, factored)
    open_ = nearly_open(problem, factored, state)
    open_blocks = (np.flatnonzero(np.isin(problem.layout.vertex[u.name], open_.vertices)) for u in problem.unknowns)
    names = [f"{u.name} {u.ids[int(k)]}" for u, blocks in zip(problem.unknowns, open_blocks) for k in blocks]
    texts = (*open_.texts, *map(OpenCombination, names), *open_.nearly)
    replace(open_, count=len(texts), texts=texts[:MOST_NAMED], more=0).refuse(
        f"no convergence in {iterations} iterations: {falling}{'; ' * bool(falling)}"
    )


def _undetermined(problem: IndexedProblem, state: State, directions: OpenDirections) -> Blocks:
    """What is to be set aside: blocks that are open by themselves, and a part that moves; nothing if all does."""
    blocks = loose_part(problem, state, directions.directions) if directions.texts else {}
    if (directions.texts and not blocks) or (
        directions.exact and 0 < len(problem.block_free) == len(directions.blocks)
    ):
        return {}
    for u in problem.unknowns:
        open_blocks = np.isin(problem.layout.vertex[u.name], directions.vertices) & u.free.any(axis=1)
        if u.eliminated:
            open_blocks |= _of_rays(problem, directions.blocks)
        if open_blocks.any():
            blocks[u.name] = open_blocks | blocks.get(u.name, False)
    return blocks


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
    if not part or not stays.any() or (moving & ~bodies).any() or unseen_motions(problem, state):
        return {}
    return part


def _note(problem: IndexedProblem, blocks: Blocks, reason: str) -> Note:
    groups = [(u.name, u.ids, blocks[u.name]) for u in problem.unknowns if u.name in blocks]
    ids = [f"{name} {one}" for name, names, out in groups for one, is_out in zip(names, out) if is_out]
    return Note("warning", f"set aside, {reason}", tuple(ids), sets_aside=True)


def _of_rays(problem: IndexedProblem, places: Int) -> Bool:
    """Which blocks of the eliminated group stand at some places among the rays' blocks."""
    is_at_place = np.zeros(len(problem.layout.block), dtype=bool)
    if problem.rays is not None:
        is_at_place[problem.rays.block[places]] = True
    return is_at_place
