"""Steps of all unknowns from a factorised linearisation: back down the tree, then block by block.

Back substitution linearises the rays once more instead of keeping their Jacobians.
"""

import numpy as np

from aatri.adjustment.elimination.chunks import over_rays
from aatri.adjustment.elimination.factor import Factored
from aatri.adjustment.elimination.joint import shared_columns
from aatri.adjustment.elimination.panels import down_the_tree, up_the_tree
from aatri.adjustment.elimination.schedule import stretches
from aatri.adjustment.kernels.back_substitution import substitute
from aatri.adjustment.records import excess, whitened
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.unknowns import State
from aatri.arrays import Float


def solve_columns(problem: IndexedProblem, factored: Factored, right: Float) -> Float:
    """Solve the reduced normal equations for several right-hand sides, (n_kept, m); zero where held."""
    x = np.where(problem.layout.fixed[:, None], 0.0, right)
    up_the_tree(problem.tree, factored.factor.all_panels, x)
    if factored.joint is not None and factored.joint.covariance is not None:
        # the other parts have nothing on their right-hand sides
        shared = shared_columns(problem)
        x[shared] = factored.joint.covariance @ x[shared]
    down_the_tree(problem.tree, factored.factor.all_panels, x)
    return np.where(problem.layout.fixed[:, None], 0.0, x)


def steps(problem: IndexedProblem, factored: Factored, state: State) -> dict[str, Float]:
    """Step of every group of unknowns at the state of the linearisation, (n, k) each; zero where held."""
    x = factored.factor.solution(problem.tree, factored.y, problem.layout.n_kept)
    dx = np.where(problem.layout.fixed, 0.0, -x)
    step: dict[str, Float] = {}
    for u in problem.unknowns:
        columns = problem.layout.columns(u.name, u.size)
        step[u.name] = np.where(columns >= 0, np.append(dx, 0.0)[columns], 0.0)
    if problem.rays is not None:
        step[problem.layout.eliminated][problem.rays.block] = _block_steps(problem, factored, state, dx)
    return step


def _block_steps(problem: IndexedProblem, factored: Factored, state: State, dx: Float) -> Float:
    rays = problem.rays
    assert rays is not None
    dy = np.zeros((len(rays.block), 3))
    fill = problem.ray_lane(state)
    parts, column = rays.parts, problem.ray_columns

    def one(_: int, p0: int, p1: int, _v: Float, A: Float, B: Float) -> None:  # dx is zero where held
        base, last = int(rays.ray_start[p0]), int(rays.ray_start[p1])
        rows = (p0, p1, base, rays.ray_start, A, B, column[base:last], parts.size, parts.start)
        substitute(*rows, dx, problem.block_free, factored.block_factor, factored.block_y, dy)

    over_rays(problem, fill, one)
    return dy


def cost_of(problem: IndexedProblem, state: State) -> float:
    """Cost of all active records: the sum of squares of the whitened residuals, unless there is a loss."""
    total, of_stretch = 0.0, np.zeros(len(stretches(problem)))
    for records, rows in problem.beside_rays:
        v, _ = whitened(records, state, rows)
        total += float((v**2).sum()) + excess(records, v)
    if problem.rays is not None:
        fill, ray_records = problem.ray_lane(state), problem.rays.records

        def one(stretch: int, _p0: int, _p1: int, v: Float, _A: Float, _B: Float) -> None:
            of_stretch[stretch] += float((v**2).sum()) + excess(ray_records, v)

        over_rays(problem, fill, one)
    cost, others = total + float(of_stretch.sum()), problem.settings.others
    return cost if others is None else others.total(cost)


def predicted_decrease(problem: IndexedProblem, factored: Factored, step: dict[str, Float]) -> float:
    """Decrease of the cost by the undamped linear model over a damped step.

    With (H + lambda diag H) s = -g it is -g's + lambda s' diag(H) s; the first term is `factored.decrease`.
    """
    if factored.damping == 0.0:
        return factored.decrease
    damped_square = 0.0
    for u in problem.unknowns:
        columns = problem.layout.columns(u.name, u.size)
        diagonal = np.where(columns >= 0, np.append(factored.diagonal, 0.0)[columns], 0.0)
        damped_square += float((diagonal * step[u.name] ** 2).sum())
    if problem.rays is not None:
        l00, l10, l20, l11, l21, l22 = factored.block_factor.T
        damped = np.stack([l00**2, l10**2 + l11**2, l20**2 + l21**2 + l22**2], axis=1)
        block_step = step[problem.layout.eliminated][problem.rays.block]
        damped_square += float((damped / (1 + factored.damping) * block_step**2).sum())
    if factored.joint is not None and problem.settings.others is not None:
        damped_square = problem.settings.others.total(damped_square) - factored.joint.counted_twice
    return factored.decrease + factored.damping * damped_square
