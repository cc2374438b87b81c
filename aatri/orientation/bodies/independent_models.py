"""Block adjustment with independent models: seven parameters per model, all models to the ground at once.

Points of the models, their perspective centres and control are observations of unknown ground points (`model_ties`,
`observations.ties`); the ground points are eliminated. Gross errors are searched and re-admitted as in the strip block
(`adjusting.tied_adjustment`). What the models disagree beyond their standard deviations is estimated as tau.

plan_height: the classical iteration (PAT-M), plan with the height held and height with the plan held, in turn, by
conjugate gradients. The common adjustment follows, for statistics, and has nothing left to do.

With the ground points eliminated, the normal equations of all models are

    | P   C | | p |   | a |        p  shift in X and Y, rotation about Z, scale: 4 unknowns a model
    | C'  H | | h | = | b |        h  shift in Z, two tilts (and the latent errors of the orientation): 3 unknowns

One round is a plan step with the height held, p = P^-1 (a - C h), and a height step with the plan held,
h = H^-1 (b - C'p). Rounds one after the other converge slowly where the perspective centres are sharp, or cross strips
tie tilts to plan: both steps then say nearly the same. Used as preconditioner of conjugate gradients, which remember
all rounds before, they end after some hundred rounds of any block. Both steps make the same sum of squares smaller, so
that the result is that of the common adjustment.

The weights and derivatives are those of the state; models move and the equations are set up anew until the step is
small. Rounds end when what is left changes no unknown by more than `SETTLED` of its standard deviation: the root of
what the sum of squares still falls by (Hestenes and Stiefel 1952: that of the last `DELAY` rounds bounds it).

Source: Ackermann, Ebner & Klein 1970, PAT-M; Ebner 1972; Hestenes and Stiefel 1952; Axelsson 1994 (block Gauss-Seidel
as preconditioner); docs/formulas.md 4.5.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from aatri.adjusting.tied_adjustment import TiedResult, adjust_tied, snooping_of
from aatri.adjusting.tied_problem import TiedProblem
from aatri.adjustment.records import whitened
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.adjustment.unknowns import State
from aatri.arrays import Bool, Float
from aatri.errors import ConvergenceError, GeometryError
from aatri.observations.poses import POINT, POSE
from aatri.observations.ties import BODY
from aatri.orientation.bodies.model_ties import HEIGHT, PLAN, ModelPoses, moved_models


def adjust_models(
    problem: TiedProblem, *, limit: float | None, active: Bool, plan_height: bool = False
) -> tuple[TiedResult, int]:
    """Adjust all models together; and in how many rounds plan and height were adjusted before, in turn.

    Parameters
    ----------
    problem : TiedProblem
        Points and perspective centres of models, control and positions.
    limit : float, optional
        Test statistic of a wrong tie or control point; None: by the number of tests.
    active : (n,) bool
        Observations to begin with; the others are tested for re-admission.
    plan_height : bool
        Plan and height in turn.

    Raises
    ------
    GeometryError
        If something is not determined.
    ConvergenceError
        If the iteration does not converge.
    """
    rounds = 0
    if plan_height:
        models, rounds = plan_and_height(problem, active)
        problem = replace(problem, start={**problem.start, BODY: models})
    return adjust_tied(problem, snooping_of(problem, limit), active=active), rounds


SETTLED = 1e-3
DELAY = 8
LINEARISATIONS = 30

ROUNDS = 5000
"""Of one linearisation at most."""


def plan_and_height(problem: TiedProblem, use: Bool) -> tuple[ModelPoses, int]:
    """Adjust plan and height in turn; the models, and how many rounds it took.

    Parameters
    ----------
    problem : TiedProblem
        Of the common adjustment.
    use : (n,) bool
        Active observations.

    Raises
    ------
    GeometryError
        If plan or height of a model is not determined.
    ConvergenceError
        If the rounds do not converge.
    """
    models: ModelPoses = problem.start[BODY]
    free, rounds = problem.unknowns[0].free, 0
    plan, height = (np.flatnonzero((free & part).ravel()) for part in (PLAN, HEIGHT))
    for _ in range(LINEARISATIONS):
        state = {**problem.start, BODY: models}
        N, g = _normals(problem.weighted(state, use), state)
        steps = _in_turn(N, plan, height, problem.what)
        dx, done = _conjugate(N, -g, steps)
        models, rounds = moved_models(models, dx.reshape(free.shape)), rounds + done
        if done >= ROUNDS:
            break
        if np.sqrt(max(float(dx @ (N @ dx)), 0.0)) < SETTLED:
            return models, rounds
    raise ConvergenceError(
        f"plan and height of the models in turn did not converge in {rounds} rounds",
        remedy="adjust both together (iteration: together), or give better initial orientations",
    )


def _normals(problem: IndexedProblem, state: State) -> tuple[Any, Float]:
    """N and half the gradient of the models' unknowns, the ground points and perspective centres eliminated."""
    columns = {BODY: problem.unknowns[0].size, POINT: 3, POSE: 3}  # of images the positions alone
    count = {u.name: len(u.free) for u in problem.unknowns}
    parts: dict[str, list[Any]] = {name: [] for name in count}
    residuals = []
    for r in problem.records:
        v, jacobians = whitened(r, state, np.arange(len(r.active)))
        residuals.append(v.ravel())
        touched = {group: (blocks, J[:, :, : columns[group]]) for (group, blocks), J in zip(r.touches, jacobians)}
        for group in parts:
            shape = (v.size, count[group] * columns[group])
            parts[group].append(_blocks(*touched[group], shape) if group in touched else sparse.csr_array(shape))
    A, v = sparse.csr_array(sparse.vstack(parts.pop(BODY))), np.concatenate(residuals)
    N, g = A.T @ A, A.T @ v
    for group, rows in parts.items():  # no observation joins a point and a centre, or two of either
        B, n = sparse.csr_array(sparse.vstack(rows)), count[group]
        D = np.zeros((n, 3, 3))
        BB = sparse.coo_array(B.T @ B)
        D[BB.row // 3, BB.row % 3, BB.col % 3] = BB.data
        D[np.einsum("nii->n", D) <= 0.0] = np.eye(3)
        inverse = sparse.bsr_array((np.linalg.inv(D), np.arange(n), np.arange(n + 1)), shape=(3 * n, 3 * n))
        AB = A.T @ B @ inverse
        N, g = N - AB @ (B.T @ A), g - AB @ (B.T @ v)
    return sparse.csc_array(N), np.asarray(g)


def _blocks(block: Any, J: Float, shape: tuple[int, int]) -> Any:
    """Jacobians (n, m, k) of records at the blocks they touch, as a sparse matrix."""
    n, m, k = J.shape
    row = np.broadcast_to(np.arange(n * m).reshape(n, m, 1), J.shape)
    column = np.broadcast_to(k * np.asarray(block)[:, None, None] + np.arange(k), J.shape)
    return sparse.csr_array((J.ravel(), (row.ravel(), column.ravel())), shape=shape)


def _in_turn(N: Any, plan: Any, height: Any, what: str) -> Callable[[Float], Float]:
    """Plan step, height step, plan step: the symmetric round that conjugate gradients need."""
    P, H, C = (
        sparse.csc_array(N[rows][:, columns]) for rows, columns in ((plan, plan), (height, height), (plan, height))
    )
    factors = []
    for name, matrix in (("plan", P), ("height", H)):
        d = matrix.diagonal()
        scale = sparse.diags_array(1.0 / np.sqrt(np.where(d > 0, d, 1.0)))
        try:
            factor = splu(
                sparse.csc_array(scale @ matrix @ scale),
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
        except RuntimeError as error:
            raise GeometryError(f"{what}: the {name} of the models is not determined") from error
        factors.append((factor, scale))
    (of_plan, s), (of_height, t) = factors

    def steps(r: Float) -> Float:
        x = np.zeros_like(r)
        p = s @ of_plan.solve(s @ r[plan])
        h = t @ of_height.solve(t @ (r[height] - C.T @ p))
        x[height] = h
        x[plan] = p - s @ of_plan.solve(s @ (C @ h))
        return x

    return steps


def _conjugate(N: Any, b: Float, steps: Callable[[Float], Float]) -> tuple[Float, int]:
    """Solve N x = b; rounds taken."""
    x, r = np.zeros_like(b), b.copy()
    z = steps(r)
    d, gamma, falls = z, float(r @ z), list[float]()
    for done in range(1, ROUNDS + 1):
        Nd = N @ d
        curvature = float(d @ Nd)
        if not curvature > 0.0:
            return x, done
        alpha = gamma / curvature
        x, r = x + alpha * d, r - alpha * Nd
        falls.append(alpha * gamma)  # what the sum of squares has fallen by
        if len(falls) >= DELAY and sum(falls[-DELAY:]) < SETTLED**2:
            return x, done
        z = steps(r)
        new = float(r @ z)
        d, gamma = z + new / gamma * d, new
        if not gamma > 0.0:
            return x, done
    return x, ROUNDS
