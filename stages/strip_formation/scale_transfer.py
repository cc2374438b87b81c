"""Strip formation by scale transfer: consecutive models share an image; common points give the scale.

Rotations and projection centres are chained through the common image. The scale of a model in the unit of the one
before follows from the distances of the common points to the common projection centre in both,

    scale = exp(mean of log r_a - log r_b),

weighted by the precision of the distances, robustly. Points whose own scale deviates are rejected and listed as
suspects of kind model_tie; their positions are left out of the strip.

A missing model or too few connection points split the strip. An image at which models do not connect is the last of
one free strip and the first of the next.

Source: docs/formulas.md 3.5, 3.6; see aatri/orientation/strips: joints.py and chain.py.
"""

from __future__ import annotations

from typing import Literal

from aatri.adapters.rejection_notes import rejection_notes
from aatri.adapters.solution import check_same_block
from aatri.adapters.strips.joined_models import JointRules, joined_models
from aatri.artifacts.block import Block
from aatri.artifacts.models import Models
from aatri.artifacts.strips import Strips
from aatri.notes import tell
from aatri.plugin import SILENT, Context, Field, Options, stage


class ScaleTransferOptions(Options):
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
    estimator: Literal["robust", "weighted", "mean"] = Field(
        "robust",
        description="weighted mean with rejection; weighted mean of all points; plain mean, as of three points",
    )
    scale_jump: float = Field(2.0, gt=1, description="a scale factor above this, or below its inverse, is reported")


@stage(version=2, uses=("images.strip",))
def scale_transfer(
    block: Block,
    models: Models,
    *,
    options: ScaleTransferOptions = ScaleTransferOptions(),
    context: Context = SILENT,
) -> Strips:
    """Join the models of every strip."""
    check_same_block(block, models.images.id, "models")
    rules = JointRules(options.min_connection_points, options.snooping_limit, options.scale_jump, options.estimator)
    strips, notes = joined_models(block, models, rules)
    tell([*notes, *rejection_notes(strips.suspects, "strip_formation")], context)
    return strips
