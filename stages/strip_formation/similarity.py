"""Strip formation by similarities: every model is turned and scaled onto the one before by their common points.

About the common projection centre, y_a = lambda T x_b: rotation T (3) and scale lambda by weighted least squares over
the common points, rejections as in strip_formation/scale_transfer. The new base is lambda T b. The rotation of the
common image, which the other variants chain through, is not used: this is how independent models are connected.

It is weaker: the turn about the row of connection points rests on how far they lie from the projection centre. At least
two points are needed, three or more to be checked.

Source: docs/formulas.md 3.6 (the lecture notes' connection of independent models); see
aatri/orientation/strips/similarity_joints.py.
"""

from __future__ import annotations

from aatri.adapters.rejection_notes import rejection_notes
from aatri.adapters.solution import check_same_block
from aatri.adapters.strips.joined_models import JointRules, joined_models
from aatri.artifacts.block import Block
from aatri.artifacts.models import Models
from aatri.artifacts.strips import Strips
from aatri.notes import tell
from aatri.plugin import SILENT, Context, Field, Options, stage


class SimilarityOptions(Options):
    """Options of the strip formation."""

    min_connection_points: int = Field(
        2, ge=1, description="models with fewer usable common points are not joined: the strip is split there"
    )
    snooping_limit: float | None = Field(
        None,
        gt=0,
        description="a connection point is rejected if its scale is wrong by more standard deviations; null: by the "
        "number of points, 4 at least",
    )
    scale_jump: float = Field(2.0, gt=1, description="a scale factor above this, or below its inverse, is reported")


@stage(version=1, uses=("images.strip",))
def similarity(
    block: Block,
    models: Models,
    *,
    options: SimilarityOptions = SimilarityOptions(),
    context: Context = SILENT,
) -> Strips:
    """Join the models of every strip."""
    check_same_block(block, models.images.id, "models")
    rules = JointRules(options.min_connection_points, options.snooping_limit, options.scale_jump, "similarity")
    strips, notes = joined_models(block, models, rules)
    tell([*notes, *rejection_notes(strips.suspects, "strip_formation")], context)
    return strips
