"""Criteria of a layout: precision, weakest point, criterion matrix, reliability, and where control would gain most.

    lambda = largest eigenvalue of K^-1 C,    K_ij = (1/2 exp(-|X_i - X_j| / distance_m) + 1/2 [i = j]) diag(sigma_m^2)

The block is a planned one (block/simulate) and the bundle its adjustment with `point_covariances: ["*"]`: theoretical
figures depend on geometry and standard deviations, not on what was measured. `aatri design` puts the layouts of a
pipeline file, its variants, side by side; state `sigma_m` and `distance_m` there, so that all meet the same criterion.

Source: Baarda 1973; Grafarend 1974. See aatri/evaluation/design.py.
"""

from aatri.artifacts.block import Block
from aatri.artifacts.evaluation import Evaluation
from aatri.artifacts.solution import Solution
from aatri.evaluation.layout_figures import CriteriaOptions, judged_layout
from aatri.plugin import SILENT, Context, stage


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
    result = judged_layout(block, solution, options)
    context.log(result.verdict)
    return result
