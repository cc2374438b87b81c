"""Block adjustment with independent models: seven parameters per model, all models to the ground at once.

Points of the models, their perspective centres and control are observations of unknown ground points (`model_ties`,
`tie_records`); the ground points are eliminated. Gross errors are searched and re-admitted as in the strip block
(`tied_adjustment`). What the models disagree beyond their standard deviations is estimated as tau.

plan_height: the classical iteration (PAT-M). In turn the plan (shift in X and Y, rotation about Z, scale, 4 unknowns a
model) is adjusted with the height of the models held, and the height (shift in Z, two tilts, 3 unknowns) with their
plan held, ground points free in both, until no model moves by more than a thousandth of its standard deviation. Both
steps make the same sum of squares smaller, so that the result is that of the common adjustment; that follows, for
statistics, and has nothing left to do.

Source: Ackermann, Ebner & Klein 1970, PAT-M; Ebner 1972; docs/formulas.md 4.5.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aatri.adjustment.statistics.rejection import Snooping
from aatri.arrays import Bool, Float, Text
from aatri.errors import ConvergenceError
from aatri.orientation.free_block.model_ties import HEIGHT, PLAN, ModelPoses, ModelRows, model_ties
from aatri.orientation.free_block.tie_records import STRIP, GivenPoints
from aatri.orientation.free_block.tied_adjustment import TiedResult, adjust_tied
from aatri.orientation.free_block.tied_solution import solve_tied, tied_problem

ROUNDS = 500
"""Of the plan-height iteration at most."""

SETTLED = 1e-3
"""Largest step of an unknown, in its standard deviations, at which the plan-height iteration ends."""


@dataclass(frozen=True)
class AdjustedModels:
    """Result of the block adjustment.

    Attributes
    ----------
    tied : TiedResult
        Observations are the rows of the models, then control.
    rounds : int
        Of the plan-height iteration; 0 without.
    """

    tied: TiedResult[ModelPoses]
    rounds: int


def adjust_models(
    rows: ModelRows, n_points: int, control: Sequence[GivenPoints], start: ModelPoses, *, names: Sequence[str] | Text,
    latent: bool, limit: float, plan_height: bool = False, active: Bool | None = None,
) -> AdjustedModels:  # fmt: skip
    """Adjust all models together.

    Parameters
    ----------
    rows : ModelRows
    n_points : int
        Ground points and perspective centres.
    control : sequence of GivenPoints
    start : ModelPoses
    names : (m,) sequence of str
    latent : bool
        Errors of the relative orientations as latent unknowns.
    limit : float
        Test statistic of a wrong tie or control point.
    plan_height : bool
        Plan and height in turn.
    active : (n + n_control,) bool, optional
        Observations to begin with; the others are tested for re-admission.

    Raises
    ------
    GeometryError
        If something is not determined.
    ConvergenceError
        If the iteration does not converge.
    """
    rounds = 0
    if plan_height:
        start, rounds = _in_turn(rows, n_points, control, start, names, latent, active)
    ties = model_ties(rows, names=names, n_points=n_points, latent=latent)
    what = "independent models"
    tied = adjust_tied(ties, control, start, Snooping(limit), what=what, active=active, points=True)
    return AdjustedModels(tied, rounds)


def _in_turn(
    rows: ModelRows, n_points: int, control: Sequence[GivenPoints], start: ModelPoses, names: Sequence[str] | Text,
    latent: bool, active: Bool | None,
) -> tuple[ModelPoses, int]:  # fmt: skip
    """Plan and height in turn."""
    state, n = start, len(rows.point) + sum(len(g.point) for g in control)
    use = np.ones(n, dtype=bool) if active is None else active
    for done in range(1, ROUNDS + 1):
        largest = 0.0
        for part in (PLAN, HEIGHT):
            ties = model_ties(rows, names=names, n_points=n_points, latent=latent, free=part)
            solved = solve_tied(tied_problem(ties, control, state, "independent models"), state, use, 0.0, None)
            before, state = state, solved.state
            sigma = np.sqrt(np.einsum("nii->ni", solved.solved.covariances().groups[STRIP]))
            step = _difference(before, state)
            largest = max(largest, float(np.max(np.abs(step) / np.where(sigma > 0, sigma, np.inf), initial=0.0)))
        if largest < SETTLED:
            return state, done
    raise ConvergenceError(
        f"plan and height of the models in turn did not converge in {ROUNDS} rounds",
        remedy="adjust both together (iteration: together), or give better initial orientations",
    )


def _difference(before: ModelPoses, after: ModelPoses) -> Float:
    """Steps (m, 12) that lead from one state to the other."""
    a, b = before.similarity, after.similarity
    turn = b.rotation @ a.rotation.swapaxes(1, 2)
    d = 0.5 * np.stack([turn[:, 2, 1] - turn[:, 1, 2], turn[:, 0, 2] - turn[:, 2, 0], turn[:, 1, 0] - turn[:, 0, 1]], 1)
    scale = np.log(b.scale / a.scale)[:, None]
    return np.concatenate([b.translation - a.translation, d, scale, after.latent - before.latent], axis=1)
