"""How errors grow along free strips: simulated strips laid on the truth by their first model, beside the laws.

Independent errors of the models grow as sigma sqrt(n) in the attitude and as sigma_b sqrt(n (n + 1)(2n + 1) / 6) in the
place, an error common to all models as n and n^2. The table `strip_errors` has them by number of the model, the report
draws them. The recipe docs/recipes/error_propagation.yaml shows both.

Source: lecture notes A601, A602; see aatri/evaluation/free_strips.py.
"""

import numpy as np

from aatri.adapters.frame.adjustment_frame import frame_of, poses_into
from aatri.artifacts.block import Block
from aatri.artifacts.evaluation import Evaluation
from aatri.artifacts.strips import Strips
from aatri.errors import InputError
from aatri.evaluation.free_strips import free_strip_errors
from aatri.plugin import SILENT, Context, stage


@stage(version=1, uses=())
def free_strips(block: Block, strips: Strips, *, context: Context = SILENT) -> Evaluation:
    """Errors of free strips by number of the model.

    Raises
    ------
    InputError
        If the block is not simulated: without truth there are no errors.
    """
    truth, n = block.true_images, len(block.images)
    if truth is None:
        raise InputError(
            "no true orientations: how free strips bend is seen on simulated blocks only",
            where="block",
            remedy="use block/simulate; of a measured block, strip_adjustment tells what bends its strips",
        )
    poses = poses_into(frame_of(block), truth.position_m, truth.ground_from_image)
    position_m, ground_from_image = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan)
    position_m[truth.image], ground_from_image[truth.image] = poses.position_m, poses.ground_from_image
    result = free_strip_errors(strips, position_m, ground_from_image)
    context.log(result.verdict)
    return result
