"""Strip formation by scale transfer: consecutive models share an image; common points give the scale.

Rotations and projection centres are chained through the common image. The scale of a model in the unit of the one
before follows from the distances of the common points to the common projection centre in both,

    scale = exp(mean of log r_a - log r_b),

weighted by the precision of the distances, robustly. Points whose own scale deviates are rejected and listed as
suspects of kind model_tie; their positions are left out of the strip.

A missing model or too few connection points split the strip. An image at which models do not connect is the last of
one free strip and the first of the next.

Source: docs/formulas.md 3.5, 3.6; see aatri/orientation/strips: scale_transfer.py, joints.py and chain.py.
"""

from __future__ import annotations

import numpy as np

from aatri.adapters.model_chains import (
    Chain,
    Gap,
    images_left_alone,
    model_table,
    strips_of,
    unbroken_runs,
)
from aatri.adapters.solution import check_same_block
from aatri.artifacts.block import Block
from aatri.artifacts.models import Models
from aatri.artifacts.strips import Strips
from aatri.errors import GeometryError
from aatri.orientation.strips.joints import JointTable, scale_transfers
from aatri.plugin import SILENT, Context, Field, Options, stage

CHECKED_POINTS = 3
"""With fewer connection points a wrong one cannot be located."""

UNSTABLE_SPREAD = 0.2
"""Connection points that cover less of the width of the models make an unstable bridge."""


class ScaleTransferOptions(Options):
    """Options of the strip formation."""

    min_connection_points: int = Field(
        2, ge=1, description="models with fewer usable common points are not joined: the strip is split there"
    )
    snooping_limit: float = Field(
        4.0, gt=0, description="a connection point is rejected if its scale is wrong by more standard deviations"
    )
    scale_jump: float = Field(2.0, gt=1, description="a scale factor above this, or below its inverse, is reported")


@stage(version=1, uses=("images.strip",))
def scale_transfer(
    block: Block,
    models: Models,
    *,
    options: ScaleTransferOptions = ScaleTransferOptions(),
    context: Context = SILENT,
) -> Strips:
    """Join the models of every strip."""
    check_same_block(block, models.images.id, "models")
    runs, gaps = unbroken_runs(block, models)
    if not runs:
        raise GeometryError(
            f"no strip: none of {len(models.unformed)} pairs of neighbouring images makes a model",
            remedy="see the reasons in the table `unformed` of the relative orientation; check strip and sequence",
        )
    table = model_table(models)
    first = np.array([model for run in runs for model in run.models[:-1]], dtype=np.int64)
    second = np.array([model for run in runs for model in run.models[1:]], dtype=np.int64)
    joints = scale_transfers(table, first, second, snooping_limit=options.snooping_limit)
    chains, breaks = _joined(block, models, runs, joints, options, context)
    gaps += breaks
    gaps += images_left_alone(block, chains)
    strips = strips_of(block, models, table, joints, chains, gaps)
    for gap in gaps:
        context.warn(f"{_place(block, gap)}: {gap.reason}")
    context.log(f"{len(chains)} free strips: {', '.join(strips.strips.id[:20])}")
    return strips


def _joined(
    block: Block, models: Models, runs: list[Chain], joints: JointTable, options: ScaleTransferOptions, context: Context
) -> tuple[list[Chain], list[Gap]]:
    """Join runs of neighbouring models, splitting them where the connection is too weak; joints in the runs' order."""
    chains: list[Chain] = []
    gaps: list[Gap] = []
    used, warnings = joints.used().tolist(), _warnings(joints, options)
    joint = -1
    for run in runs:
        chain = Chain(run.strip, run.images[:2], run.models[:1])
        chains.append(chain)
        for k, (before, model) in enumerate(zip(run.models[:-1], run.models[1:])):
            joint += 1
            image, following = run.images[k + 1], run.images[k + 2]
            if used[joint] < options.min_connection_points:
                names = f"{models.orientations.id[before]} and {models.orientations.id[model]}"
                needed = options.min_connection_points
                reason = f"models {names} share {used[joint]} usable points, {needed} are needed"
                gaps.append(Gap(run.strip, image, following, reason))
                chain = Chain(run.strip, [image, following], [model])
                chains.append(chain)
                continue
            for warning in warnings.get(joint, ()):
                names = f"{models.orientations.id[before]} and {models.orientations.id[model]}"
                context.warn(f"joint of {names} at image {block.images.id[image]}: {warning}")
            chain.models.append(model)
            chain.images.append(following)
            chain.joints.append(joint)
    return chains, gaps


def _warnings(joints: JointTable, options: ScaleTransferOptions) -> dict[int, list[str]]:
    """What is to be said of joints that are made, by joint."""
    used, worst = joints.used(), joints.largest_test()
    jumps = ~((joints.scale >= 1 / options.scale_jump) & (joints.scale <= options.scale_jump))
    few, disagree = used < CHECKED_POINTS, worst > options.snooping_limit
    unstable = ~few & (joints.spread < UNSTABLE_SPREAD)
    texts: dict[int, list[str]] = {}
    for k in np.flatnonzero(jumps | few | disagree | unstable).tolist():
        found = texts.setdefault(k, [])
        if jumps[k]:
            found.append(f"the scale jumps by a factor of {joints.scale[k]:.3g}: change of height, or wrong points")
        if few[k]:
            found.append(f"only {used[k]} connection points: a wrong one cannot be located")
        if disagree[k]:
            found.append(f"the scales of the connection points disagree by {worst[k]:.1f} standard deviations")
        if unstable[k]:
            covered = f"the connection points cover {joints.spread[k]:.0%} of the width of the models"
            found.append(f"bridge unstable: {covered}")
    return texts


def _place(block: Block, gap: Gap) -> str:
    strip = f"strip {block.strips.id[gap.strip]}" if gap.strip >= 0 else "no strip"
    images = " - ".join(str(block.images.id[row]) for row in (gap.left, gap.right) if row >= 0)
    return f"{strip}, {images}"
