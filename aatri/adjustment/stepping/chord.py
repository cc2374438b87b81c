"""Chord steps: near the end the factor of an earlier iteration serves a new gradient.

    N(x0) dx = -g(x),     x0: where the factor was made, x: where the iteration has come to

The gradient is exact, so that the iteration has the optimum of Newton's method; its error falls by a constant factor a
step, some twice the ratio of the last two decrements. Ground points are eliminated anew: exact are D, h and A'B, old is
the reduced normal matrix alone. A step costs a pass over the rays and one through the factor, some third of a
factorisation of a large block.

Source: Kelley 1995, Iterative methods for linear and nonlinear equations, 5.4.1 (chord method).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aatri.adjustment.elimination.chunks import linearised, side_by_side
from aatri.adjustment.elimination.factor import Factored
from aatri.adjustment.elimination.fronts import own_normals
from aatri.adjustment.elimination.joint import joined
from aatri.adjustment.elimination.panels import up_the_tree
from aatri.adjustment.elimination.schedule import Stretch, in_shares
from aatri.adjustment.kernels.block_factors import block_factors
from aatri.adjustment.kernels.implicit import onto_kept
from aatri.adjustment.structure.index import part_columns
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.threads import one_blas_thread
from aatri.adjustment.unknowns import State
from aatri.arrays import Float


def allows_chord(problem: IndexedProblem) -> bool:
    """Whether the gradient alone changes from step to step, in all parts: no constraints, no weights that move."""
    moves = any(r.loss is not None or r.normal is not None for r in problem.records)
    beside, others = bool(problem.constraints) or problem.iterative is not None or moves, problem.settings.others
    return not beside if others is None else others.total(float(beside)) == 0.0


def on_earlier_factor(problem: IndexedProblem, earlier: Factored, state: State) -> Factored:
    """The linearisation at a state, but for the reduced normal matrix, which is that of an earlier one.

    Parameters
    ----------
    problem : IndexedProblem
        That of `earlier`, and one that `allows_chord`.
    earlier : Factored
        Undamped; its factor is shared.
    """
    layout, n_blocks = problem.layout, len(problem.block_free)
    own = own_normals(problem, state)
    factors = np.ones((n_blocks, 6)), np.zeros((n_blocks, 3)), np.ones(n_blocks)
    gradient, cost = np.zeros(layout.n_kept + 1), own[2]
    for kept in problem.kept:
        v, A = side_by_side(kept, layout, state)
        np.add.at(gradient, part_columns(kept.parts, layout), np.einsum("nia,ni->na", A, v))
        cost += float((v**2).sum())
    gradient = gradient[:-1]
    if problem.rays is not None:
        of_rays, cost_of_rays = _of_rays(problem, state, own[:2], factors)
        gradient, cost = gradient + of_rays, cost + cost_of_rays
    gradient = np.where(layout.fixed, 0.0, gradient)
    with one_blas_thread():
        up_the_tree(problem.tree, earlier.factor.all_panels, gradient[:, None])
    y = [gradient[node.columns[: node.panel]] for node in problem.tree.nodes]
    block_factor, block_y, determined = factors
    new = replace(
        earlier,
        y=y,
        block_factor=block_factor,
        block_y=block_y,
        determined=determined,
        cost=cost,
        is_chord=True,
        joint=None,
    )
    if problem.settings.others is None:
        return new
    root = (
        None if earlier.root is None else (earlier.root[0], gradient[problem.tree.nodes[-1].columns], earlier.root[2])
    )
    return joined(problem, new, root, problem.settings.others)


def _of_rays(
    problem: IndexedProblem, state: State, own: tuple[Float, Float], factors: tuple[Float, Float, Float]
) -> tuple[Float, float]:
    """Gradient of the kept unknowns (n_kept,) and sum of squares of all rays; fills in the factors of the blocks."""
    rays, fill, (L, y, determined) = problem.rays, problem.ray_lane(state), factors
    assert rays is not None

    def one(stretches: Sequence[Stretch]) -> tuple[Float, float]:
        gradient, cost = np.zeros(problem.layout.n_kept), 0.0
        for stretch in stretches:
            for p0, p1, v, A, B in linearised(problem, fill, stretch):
                base, last = int(rays.ray_start[p0]), int(rays.ray_start[p1])
                place, free = (p0, p1, base, rays.ray_start), problem.block_free
                cost += block_factors(*place, v, B, *own, free, L, y, determined)
                columns = (problem.ray_columns[base:last], rays.parts.size, rays.parts.start)
                onto_kept(*place, A, B, *columns, free, L, v, y, gradient)
        return gradient, cost

    parts = in_shares(problem, one)
    return np.sum([gradient for gradient, _ in parts], axis=0), float(sum(cost for _, cost in parts))
