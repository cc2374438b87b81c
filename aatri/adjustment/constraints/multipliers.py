"""Exact constraints c(x) = 0 among any unknowns, by multipliers.

A constraint is given as the record an observation of the same kind would be (`Records`), without regard to the size of
its standard deviations: what may be observed may be demanded. At each linearisation

    minimise |v + A dx|^2  subject to  C dx + c = 0

    N dx + C'k + g = 0,     N = A'A + C'W C,     g = A'v + C'W c,     W = diag(rho)

W adds nothing: C'W (C dx + c) = 0 at the solution. It makes N regular where only the constraints determine an unknown;
it enters as a record of weight rho, with the fill-in of an observation, and rho is the smallest for which one of the
touched unknowns has doubled its weight, so that it spoils no condition. With N = L L' and the columns U = L^-1 C',
y = L^-1 g, which one forward substitution gives,

    S = U'U = C N^-1 C',    S k = c - U'y,    dx = -L^-T (y + U k),    Q = N^-1 - Z S^-1 Z',    Z = L^-T U

y + U k takes the place of y: back substitution, Newton decrement |y + U k|, and step control are those of the
adjustment without constraints. (Proof: C dx = -U'(y + U k) = -c, and N dx = -L (y + U k) = -g - C'k. Q is the upper
left block of the inverse of [N C'; C 0], whatever rho.) A constraint counts as an observation in the redundancy.

A step is judged by v'v + 4 |k|'|c|, whose descent direction it is (an exact penalty: the factor must exceed 2). Linear
constraints hold from the first full step on; others up to the square of the last step, which is below 1e-3 sigma.

Source: Nocedal & Wright, Numerical Optimization, ch. 16 and 18; docs/formulas.md 6.5.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aatri.adjustment.elimination.factor import Factored, forward_substituted
from aatri.adjustment.elimination.fronts import factorise
from aatri.adjustment.elimination.right_hand_sides import Sides, forward
from aatri.adjustment.kernels.eliminate import RANK_TOLERANCE
from aatri.adjustment.records import Records, whitened
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.unknowns import State, Unknowns
from aatri.arrays import Bool, Float, Int
from aatri.errors import GeometryError

PENALTY = 4.0
"""Weight of a violated constraint in the cost of a step, in its multipliers."""


def support(
    unknowns: Sequence[Unknowns], records: Sequence[Records], constraints: Sequence[Records], state: State
) -> tuple[Records, ...]:
    """The constraints as records of weight rho: what makes the normal matrix regular and their unknowns share a front.

    Parameters
    ----------
    unknowns, records
        The problem without them.
    state : mapping
        Where rho is found.

    Raises
    ------
    GeometryError
        If a constraint does not depend on any free unknown at the start.
    """
    if not constraints:
        return ()
    weight = _weights(unknowns, records, constraints, state)
    free = {u.name: u.free for u in unknowns}
    supports = []
    for r in constraints:
        _, jacobians = whitened(r, state, np.arange(len(r.active)))
        limit, size = np.full(r.whitener.shape[:2], np.inf), np.zeros(r.whitener.shape[:2])
        for (group, block), J in zip(r.touches, jacobians):
            square = J**2 * free[group][block][:, None, :]
            size += square.sum(axis=2)
            own = np.broadcast_to(weight[group][block][:, None, :], square.shape)
            share = np.divide(own, square, out=np.full(square.shape, np.inf), where=(square > 0) & (own > 0))
            limit = np.minimum(limit, share.min(axis=2))
        empty = np.argwhere(_used(r) & ~(size > 0))
        if len(empty):
            raise GeometryError(
                f"constraint {r.called(int(empty[0][0]))} does not depend on any free unknown at the start",
                remedy="leave it out, or free one of the unknowns it touches",
            )
        rho = np.where(np.isfinite(limit), limit, 1.0 / np.where(size > 0, size, 1.0))
        root = np.sqrt(rho) if r.whitener.ndim == 2 else np.sqrt(rho)[:, :, None]
        supports.append(replace(r, whitener=root * r.whitener))
    return tuple(supports)


def factorise_constrained(problem: IndexedProblem, state: State, damping: float = 0.0) -> Factored:
    """`factorise`, then the forward-substituted gradient of the constrained step in place of the free one.

    A problem whose factor has no room is solved by conjugate gradients.

    Raises
    ------
    GeometryError
        If the constraints depend on each other; the message names them.
    """
    if problem.iterative is not None:
        from aatri.adjustment.iterative.conjugate_gradients import (
            solve_by_conjugate_gradients,  # compiled only where it is needed
        )

        return solve_by_conjugate_gradients(problem, state, damping)
    factored = factorise(problem, state, damping)
    regular = not factored.lost and bool((factored.determined != 0).all())
    if not problem.constraints or not regular or not np.isfinite(factored.cost):
        return factored
    c, right = linearised_constraints(problem, state)
    if not (np.isfinite(c).all() and np.isfinite(right.kept).all() and np.isfinite(right.of_block).all()):
        return replace(factored, cost=np.inf)
    u = forward(problem, factored, state, right)
    y = forward_substituted(problem.tree, factored.y, problem.layout.n_kept)
    projected = u.kept.T @ y + np.einsum("pam,pa->m", u.of_block, factored.block_y[u.block])
    k = np.linalg.solve(gram(problem, u), c - projected)
    y += u.kept @ k
    block_y = factored.block_y.copy()
    block_y[u.block] += u.of_block @ k
    parts = [y[node.columns[: node.panel]] for node in problem.tree.nodes]
    return replace(factored, y=parts, block_y=block_y, multiplier=k, violation=c)


def penalty(problem: IndexedProblem, state: State, factored: Factored) -> float:
    """What the violation of the constraints at a state adds to its cost, by the multipliers of a linearisation."""
    if not len(factored.multiplier):
        return 0.0
    parts = [whitened(r, state, np.arange(len(r.active)))[0][_used(r)] for r in problem.constraints]
    return PENALTY * float(np.abs(factored.multiplier * np.concatenate(parts)).sum())


def predicted_by_constraints(factored: Factored) -> float:
    """Predicted decrease of the cost with penalty, beside that of a step without constraints: 4 |k|'|c| - 2 k'c."""
    kc = factored.multiplier * factored.violation
    return float(PENALTY * np.abs(kc).sum() - 2 * kc.sum())


def linearised_constraints(problem: IndexedProblem, state: State) -> tuple[Float, Sides]:
    """Violation c and the columns of C'."""
    layout = problem.layout
    used = [_used(r) for r in problem.constraints]
    m = sum(int(u.sum()) for u in used)
    kept, place = np.zeros((layout.n_kept, m)), _block_places(problem)
    inner: list[tuple[Int, Int, Float]] = [(np.zeros(0, dtype=int), np.zeros(0, dtype=int), np.zeros((0, 3)))]
    violation, first = [], 0
    for r, use in zip(problem.constraints, used):
        v, jacobians = whitened(r, state, np.arange(len(r.active)))
        row, component = np.nonzero(use)
        number = first + np.arange(len(row))
        violation.append(v[use])
        for (group, block), J in zip(r.touches, jacobians):
            size = J.shape[2]
            columns = layout.columns(group, size)[block[row]]
            at, scalar = np.nonzero(columns >= 0)
            np.add.at(kept, (columns[at, scalar], number[at]), J[row[at], component[at], scalar])
            if group == layout.eliminated and len(place):
                p = place[block[row]]
                stays = p >= 0
                inner.append((p[stays], number[stays], J[row, component][stays] * problem.block_free[p[stays]]))
        first += len(row)
    touched, where = np.unique(np.concatenate([p for p, _, _ in inner]), return_inverse=True)
    of_block, number = np.zeros((len(touched), 3, m)), np.concatenate([n for _, n, _ in inner])
    np.add.at(of_block, (where[:, None], np.arange(3), number[:, None]), np.concatenate([J for _, _, J in inner]))
    return np.concatenate(violation), Sides(kept, touched, of_block)


def gram(problem: IndexedProblem, u: Sides) -> Float:
    """S = C N^-1 C'.

    Raises
    ------
    GeometryError
        If it is singular.
    """
    S = u.gram()
    diagonal = np.diagonal(S)
    scale = np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    values, vectors = np.linalg.eigh(S / np.outer(scale, scale))
    if values[0] > RANK_TOLERANCE:
        return S
    names = [r.called(int(row)) for r in problem.constraints for row in np.nonzero(_used(r))[0]]
    largest = np.argsort(-np.abs(vectors[:, 0]), kind="stable")[:4]
    members = dict.fromkeys(names[i] for i in largest if abs(vectors[i, 0]) > 0.3 * abs(vectors[largest[0], 0]))
    raise GeometryError(
        f"the constraints depend on each other: {' with '.join(members)}", remedy="leave one of them out"
    )


def _weights(
    unknowns: Sequence[Unknowns], records: Sequence[Records], constraints: Sequence[Records], state: State
) -> dict[str, Float]:
    """Diagonal of the normal matrix for the blocks that constraints touch, (n, k) per group."""
    diagonal = {u.name: np.zeros(u.free.shape) for u in unknowns}
    met = {u.name: np.zeros(len(u.free), dtype=bool) for u in unknowns}
    for r in constraints:
        for group, block in r.touches:
            met[group][block[r.active]] = True
    for r in records:
        touching = np.zeros(len(r.active), dtype=bool)
        for group, block in r.touches:
            touching |= met[group][block]
        rows = np.flatnonzero(touching & r.active)
        _, jacobians = whitened(r, state, rows)
        for (group, block), J in zip(r.touches, jacobians):
            np.add.at(diagonal[group], block[rows], (J**2).sum(axis=1))
    return diagonal


def _used(r: Records) -> Bool:
    """Components that are demanded, (n, m)."""
    size = np.abs(r.whitener) if r.whitener.ndim == 2 else np.abs(r.whitener).max(axis=2)
    return np.asarray((size > 0) & r.active[:, None])


def _block_places(problem: IndexedProblem) -> Int:
    """Place among the rays' blocks of each block of the eliminated group, -1 where retained."""
    if problem.rays is None:
        return np.zeros(0, dtype=np.int64)
    place = np.full(len(problem.layout.block), -1)
    place[problem.rays.block] = np.arange(len(problem.rays.block))
    return place
