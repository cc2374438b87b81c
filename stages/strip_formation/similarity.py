"""Strip formation by similarities: every model is turned and scaled onto the one before by their common points.

About the common projection centre, y_a = lambda T x_b: rotation T (3) and scale lambda by weighted least squares over
the common points, rejections as in strip_formation/scale_transfer. The new base is lambda T b. The rotation of the
common image, which the other variants chain through, is not used: this is how independent models are connected.

It is weaker: the turn about the row of connection points rests on how far they lie from the projection centre. At least
two points are needed, three or more to be checked.

Source: docs/formulas.md 3.6 (the lecture notes' connection of independent models); see
aatri/orientation/strips/similarity_joints.py.
"""

from aatri.artifacts.block import Block
from aatri.artifacts.models import Models
from aatri.artifacts.strips import Strips
from aatri.orientation.strips.similarity_joints import similarity_joints
from aatri.plugin import SILENT, Context, stage

from ._joined import SnoopingOptions, joined, limit_of_joints


@stage(version=1, uses=("images.strip",))
def similarity(
    block: Block,
    models: Models,
    *,
    options: SnoopingOptions = SnoopingOptions(),
    context: Context = SILENT,
) -> Strips:
    """Join the models of every strip."""
    limit = limit_of_joints(models, options.snooping_limit)
    return joined(block, models, similarity_joints, options, context, limit=limit, rejecting=True)
