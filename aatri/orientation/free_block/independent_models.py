"""Block adjustment with independent models: seven parameters per model, all models to the ground at once.

Points of the models, their perspective centres and control are observations of unknown ground points (`model_ties`,
`tie_records`); the ground points are eliminated. Gross errors are searched and re-admitted as in the strip block
(`tied_adjustment`). What the models disagree beyond their standard deviations is estimated as tau.

plan_height: the classical iteration (PAT-M). In turn the plan (shift in X and Y, rotation about Z, scale, 4 unknowns a
model) is adjusted with the height of the models held, and the height (shift in Z, two tilts, 3 unknowns) with their
plan held, ground points free in both, until no model moves by more than a thousandth of its standard deviation. Both
steps make the same sum of squares smaller, so that the result is that of the common adjustment; that follows, for
statistics, and has nothing left to do. Where perspective centres are sharp, plan and tilts depend on each other so much
that hundreds of rounds would not do; each round begins where the last ones, combined, would have stood still.

Source: Ackermann, Ebner & Klein 1970, PAT-M; Ebner 1972; Anderson, J. ACM 12 (1965) 547; docs/formulas.md 4.5.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aatri.adjustment.statistics.rejection import Snooping
from aatri.arrays import Bool, Float, Text
from aatri.errors import ConvergenceError
from aatri.geometry.rotations import log_rotation
from aatri.orientation.free_block.model_ties import (
    HEIGHT,
    LATENT,
    PLAN,
    ModelPoses,
    ModelRows,
    model_ties,
    moved_models,
)
from aatri.orientation.free_block.tie_records import STRIP, GivenPoints
from aatri.orientation.free_block.tied_adjustment import TiedResult, adjust_tied
from aatri.orientation.free_block.tied_solution import solve_tied, tied_problem

ROUNDS = 500
"""Of the plan-height iteration at most."""

REMEMBERED = 20
"""Rounds that the acceleration looks back on."""

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
    """Plan and height in turn, accelerated: the steps of the last rounds tell what goes on slowly (Anderson 1965)."""
    n = len(rows.point) + sum(len(g.point) for g in control)
    use = np.ones(n, dtype=bool) if active is None else active
    sigma, here, gone = None, np.zeros((len(start.latent), 7 + LATENT)), _Gone([], [])
    for done in range(1, ROUNDS + 1):
        state = moved_models(start, here)
        sigmas = np.zeros_like(here)
        for part in (PLAN, HEIGHT):
            ties = model_ties(rows, names=names, n_points=n_points, latent=latent, free=part)
            solved = solve_tied(tied_problem(ties, control, state, "independent models"), state, use, 0.0, None)
            state = solved.state
            if sigma is None:
                sigmas += np.sqrt(np.einsum("nii->ni", solved.solved.covariances().groups[STRIP]))
        if sigma is None:
            sigma = np.where(sigmas > 0, sigmas, np.inf)
        there = _difference(start, state)
        if float(np.max(np.abs(there - here) / sigma, initial=0.0)) < SETTLED:
            return state, done
        here = gone.next(here, there, sigma)
    raise ConvergenceError(
        f"plan and height of the models in turn did not converge in {ROUNDS} rounds",
        remedy="adjust both together (iteration: together), or give better initial orientations",
    )


@dataclass(frozen=True)
class _Gone:
    """Where the last rounds ended and how far they went, in standard deviations of a round."""

    ends: list[Float]
    steps: list[Float]

    def next(self, here: Float, there: Float, sigma: Float) -> Float:
        """Where the next round begins: the combination of the ends of rounds whose step is smallest."""
        self.ends.append(there)
        self.steps.append((there - here) / sigma)
        del self.ends[:-REMEMBERED], self.steps[:-REMEMBERED]
        if len(self.steps) < 2:
            return there
        last = self.steps[-1]
        changes = np.stack([(last - step).ravel() for step in self.steps[:-1]], axis=1)
        share = np.linalg.lstsq(changes, last.ravel(), rcond=1e-10)[0]
        back: Float = sum((w * (there - end) for w, end in zip(share, self.ends[:-1])), np.zeros_like(there))
        return there - back


def _difference(before: ModelPoses, after: ModelPoses) -> Float:
    """Steps (m, 12) that lead from one state to the other."""
    a, b = before.similarity, after.similarity
    turn = log_rotation(b.rotation @ a.rotation.swapaxes(1, 2))
    scale = np.log(b.scale / a.scale)[:, None]
    return np.concatenate([b.translation - a.translation, turn, scale, after.latent - before.latent], axis=1)
