"""Congruence of two surveys: which of the given ground points have moved between the coordinate lists of two blocks.

As epochs/congruence, with the coordinates and covariances that two blocks give for their control and check points:

    d = x2 - x1,    C(d) = C1 + C2

A survey made again before a flight is compared with the first one so, and a control point that sinks is found before
it bends the block. Covariances between points (`ground_point_covariances`) are used where the block has them.

Source: Pelzer 1971; Niemeier 1981; Caspary 1987. See aatri/evaluation/congruence.py.
"""

from typing import Literal

from aatri.artifacts.block import Block
from aatri.artifacts.evaluation import Evaluation
from aatri.evaluation.epoch_points import surveyed_points
from aatri.evaluation.epochs import compared
from aatri.plugin import SILENT, Context, Field, Options, stage


class SurveyComparison(Options):
    """Options of the comparison."""

    datum: Literal["none", "shift", "rigid", "similarity"] = Field(
        "none", description="how one survey's datum may have moved against the other's"
    )
    level: float = Field(0.05, gt=0, lt=1, description="probability of a false alarm anywhere")


@stage(version=1, uses=())
def surveys(
    block: Block,
    earlier_block: Block,
    *,
    options: SurveyComparison = SurveyComparison(),
    context: Context = SILENT,
) -> Evaluation:
    """Compare two surveys.

    Raises
    ------
    InputError
        If the surveys have no point in common.
    GeometryError
        If the points do not determine the movement of the datum.
    """
    result, warnings = compared(
        surveyed_points(earlier_block, "earlier_block"),
        surveyed_points(block, "block"),
        options.datum,
        level=options.level,
    )
    for warning in warnings:
        context.warn(warning)
    context.log(result.verdict)
    return result
