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

from typing import Literal

from aatri.artifacts.block import Block
from aatri.artifacts.models import Models
from aatri.artifacts.strips import Strips
from aatri.orientation.strips.joints import with_mean_scales
from aatri.plugin import SILENT, Context, Field, stage

from ._joined import SnoopingOptions, joined, limit_of_joints


class ScaleTransferOptions(SnoopingOptions):
    """Options of the strip formation."""

    estimator: Literal["robust", "weighted", "mean"] = Field(
        "robust",
        description="weighted mean with rejection; weighted mean of all points; plain mean, as of three points",
    )


@stage(version=2, uses=("images.strip",))
def scale_transfer(
    block: Block,
    models: Models,
    *,
    options: ScaleTransferOptions = ScaleTransferOptions(),
    context: Context = SILENT,
) -> Strips:
    """Join the models of every strip."""
    plain, limit = options.estimator == "mean", limit_of_joints(models, options.snooping_limit)
    return joined(
        block,
        models,
        lambda _, joints: with_mean_scales(joints) if plain else joints,
        options,
        context,
        limit=limit,
        rejecting=options.estimator == "robust",
    )
