"""Criteria of a layout: precision, weakest point, criterion matrix, reliability, and where control would gain most.

    lambda = largest eigenvalue of K^-1 C,    K_ij = (1/2 exp(-|X_i - X_j| / distance_m) + 1/2 [i = j]) diag(sigma_m^2)

The block is a planned one (block/simulate) and the bundle its adjustment with `point_covariances: ["*"]`: theoretical
figures depend on geometry and standard deviations, not on what was measured. `aatri design` puts the layouts of a
pipeline file, its variants, side by side; state `sigma_m` and `distance_m` there, so that all meet the same criterion.

Source: Baarda 1973; Grafarend 1974. See aatri/evaluation/design.py.
"""

from typing import Annotated, Literal

import numpy as np

from aatri.artifacts.block import Block
from aatri.artifacts.evaluation import Evaluation
from aatri.artifacts.solution import Solution
from aatri.evaluation.layout_figures import Goal, judged_layout
from aatri.plugin import SILENT, Context, Field, Options, stage

Sigma = Annotated[float, Field(gt=0)]
Sigmas = tuple[Sigma, Sigma, Sigma]


class CriteriaOptions(Options):
    """Options of the criteria."""

    sigma_m: Sigmas | None = Field(
        None,
        description="standard deviations of X, Y, Z asked of every point, m; null: the medians of the block itself",
    )
    distance_m: float | None = Field(
        None, gt=0, description="over which errors may be alike, m; null: half the extent of the block"
    )
    control_sigma_m: Sigmas = Field((0.02, 0.02, 0.02), description="of one more control point, m; .inf: not measured")
    aim: Literal["mean", "worst"] = Field("mean", description="what one more control point is to make small")
    next_points: int = Field(3, ge=0, le=20, description="control points chosen one beside the other")


@stage(version=1, uses=())
def criteria(
    block: Block, solution: Solution, *, options: CriteriaOptions = CriteriaOptions(), context: Context = SILENT
) -> Evaluation:
    """Judge a layout.

    Raises
    ------
    InputError
        If the solution has no covariances between its points.
    """
    goal = Goal(
        None if options.sigma_m is None else np.array(options.sigma_m),
        options.distance_m,
        np.array(options.control_sigma_m),
        options.aim,
        options.next_points,
    )
    result = judged_layout(block, solution, goal)
    context.log(result.verdict)
    return result
