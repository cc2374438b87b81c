"""Accuracy of a Solution: control and check differences, truth against theory.

Control differences tell how the fit went, check differences how good the block is, and a simulated block tells how
good its theoretical standard deviations are. They are kept apart. RMSE = sqrt(sum d^2 / n), d = solution minus given;
the bias is the mean of d. Every stereo pair is restituted by itself too, with the orientations of the solution.
Definitions: docs/methods/accuracy.md.
"""

from functools import partial

from aatri.adapters.frame.adjustment_frame import frame_of, points_out_of, solution_into
from aatri.artifacts.block import Block
from aatri.artifacts.evaluation import Evaluation
from aatri.artifacts.solution import Solution
from aatri.evaluation.accuracy import evaluate
from aatri.evaluation.alignment import in_frame_of_check
from aatri.evaluation.doming import check_notes
from aatri.evaluation.limits import ENOUGH_CHECK_POINTS
from aatri.evaluation.single_models import single_models, with_models
from aatri.notes import tell
from aatri.plugin import SILENT, Context, Field, Options, stage


class EvaluationOptions(Options):
    """Options of the evaluation."""

    confidence: float = Field(0.95, gt=0, lt=1, description="probability of the chi-square intervals of check RMSE")
    enough_check_points: int = Field(
        ENOUGH_CHECK_POINTS, ge=1, description="fewer check points than this are remarked upon"
    )


@stage(version=2, uses=("ground_points:check",))
def evaluation(
    block: Block,
    solution: Solution,
    *,
    options: EvaluationOptions = EvaluationOptions(),
    context: Context = SILENT,
) -> Evaluation:
    """Empirical and theoretical accuracy of a Solution."""
    result = evaluate(block, solution, confidence=options.confidence, enough=options.enough_check_points)
    frame = frame_of(block)
    poses, xyz_m = solution_into(frame, solution)
    compared = in_frame_of_check(block, solution)
    models = single_models(block, solution, poses, xyz_m, partial(points_out_of, frame), compared=compared)
    result = with_models(result, models, compared=compared)
    context.log(" ".join(result.verdict.splitlines()))
    tell(check_notes(result, block, solution), context)
    return result
