"""Block adjustment with independent models: seven parameters per model, all models to the ground at once.

Points of the models, their perspective centres and control are observations of unknown ground points (`model_ties`,
`tie_records`); the ground points are eliminated. Gross errors are searched and re-admitted as in the strip block
(`tied_adjustment`). What the models disagree beyond their standard deviations is estimated as tau.

plan_height: the classical iteration (PAT-M), plan with the height held and height with the plan held, in turn
(`plan_height`). The common adjustment follows, for statistics, and has nothing left to do.

Source: Ackermann, Ebner & Klein 1970, PAT-M; Ebner 1972; docs/formulas.md 4.5.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aatri.adjustment.statistics.rejection import Snooping
from aatri.arrays import Bool, Text
from aatri.orientation.free_block.model_ties import (
    ModelPoses,
    ModelRows,
    model_ties,
)
from aatri.orientation.free_block.plan_height import plan_and_height
from aatri.orientation.free_block.tie_records import GivenPoints
from aatri.orientation.free_block.tied_adjustment import TiedResult, adjust_tied
from aatri.orientation.free_block.tied_solution import tied_problem


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
    ties, rounds = model_ties(rows, names=names, n_points=n_points, latent=latent), 0
    what = "independent models"
    if plan_height:
        use = np.ones(len(rows.point) + sum(len(g.point) for g in control), dtype=bool) if active is None else active
        start, rounds = plan_and_height(tied_problem(ties, control, start, what), start, use)
    tied = adjust_tied(ties, control, start, Snooping(limit), what=what, active=active, points=True)
    return AdjustedModels(tied, rounds)
