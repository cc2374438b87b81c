"""Two calibrations of the same cameras: what has changed between them, before and after a transport or a season.

    d = p2 - p1,    C(d) = C1 + C2

All parameters are tested together; where they do not agree, the parameter that alone explains most is named, until the
rest agrees. Each change comes with its standard deviation and the smallest change found with 80 %. Both calibrations
are finished bundles, of the same set or camera model. Where both rest on the same control, its errors are common to
both and the test is on the safe side.

Source: congruence tests as of epochs/congruence; lecture notes A1508 on test fields.
"""

from aatri.artifacts.evaluation import Evaluation
from aatri.artifacts.solution import Solution
from aatri.evaluation.calibrations import compared_calibrations
from aatri.plugin import SILENT, Context, Field, Options, stage


class CamerasOptions(Options):
    """Options of the comparison."""

    level: float = Field(0.05, gt=0, lt=1, description="probability of a false alarm anywhere")


@stage(version=1, uses=())
def cameras(
    solution: Solution,
    earlier: Solution,
    *,
    options: CamerasOptions = CamerasOptions(),
    context: Context = SILENT,
) -> Evaluation:
    """Compare two calibrations.

    Raises
    ------
    InputError
        If they have no determined parameter in common.
    """
    result = compared_calibrations(earlier, solution, level=options.level)
    context.log(result.verdict)
    return result
