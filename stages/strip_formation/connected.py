"""Strip formation from connected models: scales are those that the models carry.

Models of relative_orientation/connected were adjusted together with their scale in units of the model before; the
scales multiply along the strip, nothing is estimated here. Rotations and projection centres are chained through the
common images as in strip_formation/scale_transfer. Connection points that the orientation rejected are left out of
both models. A model that carries no scale splits the strip.

Source: docs/formulas.md 3.5, 3.6; the lecture notes' relative orientation with model connection, errata E08.
"""

from aatri.adapters.strips.model_chains import carried_scales
from aatri.adjustment.statistics.limits import LEAST_LIMIT
from aatri.artifacts.block import Block
from aatri.artifacts.models import Models
from aatri.artifacts.strips import Strips
from aatri.orientation.strips.joints import JointTable, ModelTable, with_given_scales
from aatri.plugin import SILENT, Context, stage

from ._joined import JoiningOptions, joined


@stage(version=1, uses=("images.strip",))
def connected(
    block: Block,
    models: Models,
    *,
    options: JoiningOptions = JoiningOptions(),
    context: Context = SILENT,
) -> Strips:
    """Join the models of every strip."""

    def carried(_: ModelTable, joints: JointTable) -> JointTable:
        return with_given_scales(joints, *carried_scales(models, joints))

    return joined(block, models, carried, options, context, limit=LEAST_LIMIT, rejecting=False)
