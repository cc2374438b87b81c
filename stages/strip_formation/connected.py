"""Strip formation from connected models: scales are those that the models carry.

Models of relative_orientation/connected were adjusted together with their scale in units of the model before; the
scales multiply along the strip, nothing is estimated here. Rotations and projection centres are chained through the
common images as in strip_formation/scale_transfer. Connection points that the orientation rejected are left out of
both models. A model that carries no scale splits the strip.

Source: docs/formulas.md 3.5, 3.6; the lecture notes' relative orientation with model connection, errata E08.
"""

from __future__ import annotations

from aatri.adapters.solution import check_same_block
from aatri.adapters.strips.joined_models import JointRules, joined_models
from aatri.artifacts.block import Block
from aatri.artifacts.models import Models
from aatri.artifacts.strips import Strips
from aatri.notes import tell
from aatri.plugin import SILENT, Context, Field, Options, stage


class ConnectedOptions(Options):
    """Options of the strip formation."""

    min_connection_points: int = Field(
        2, ge=1, description="models with fewer usable common points are not joined: the strip is split there"
    )
    scale_jump: float = Field(2.0, gt=1, description="a scale factor above this, or below its inverse, is reported")


@stage(version=1, uses=("images.strip",))
def connected(
    block: Block,
    models: Models,
    *,
    options: ConnectedOptions = ConnectedOptions(),
    context: Context = SILENT,
) -> Strips:
    """Join the models of every strip."""
    check_same_block(block, models.images.id, "models")
    rules = JointRules(options.min_connection_points, 4.0, options.scale_jump, "connected")
    strips, notes = joined_models(block, models, rules)
    tell(notes, context)
    return strips
