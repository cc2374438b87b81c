"""Strip formation by scale transfer: consecutive models share an image; common points give the scale.

Rotations and projection centres are chained through the common image. The scale of a model in the unit of the one
before follows from the distances of the common points to the common projection centre in both,

    scale = exp(mean of log r_a - log r_b),

weighted by the precision of the distances, robustly. Points whose own scale deviates are rejected and listed as
suspects of kind model_tie; their positions are left out of the strip.

A missing model or too few connection points split the strip. An image at which models do not connect is the last of
one free strip and the first of the next.

Source: photogrammetry.md A404-A410; see aatri/orientation/strips/scale_transfer.py and strip.py.
"""

from __future__ import annotations

import numpy as np

from aatri.adapters.model_chains import (
    Chain,
    Gap,
    free_strip_ids,
    images_left_alone,
    model_geometry,
    strips_of,
    unbroken_runs,
)
from aatri.adapters.solution import check_same_block
from aatri.artifacts.block import Block
from aatri.artifacts.models import Models
from aatri.artifacts.strips import Strips
from aatri.errors import GeometryError
from aatri.orientation.strips.chain import form_strip
from aatri.orientation.strips.scale_transfer import Joint, Model, common_points
from aatri.orientation.strips.scale_transfer import scale_transfer as transfer
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
    geometry = model_geometry(models)
    runs, gaps = unbroken_runs(block, models)
    if not runs:
        raise GeometryError(
            f"no strip: none of {len(models.unformed)} pairs of neighbouring images makes a model",
            remedy="see the reasons in the table `unformed` of the relative orientation; check strip and sequence",
        )
    chains: list[Chain] = []
    for run in runs:
        parts, breaks = _joined(block, models, run, geometry, options, context)
        chains += parts
        gaps += breaks
    gaps += images_left_alone(block, chains)
    formed = [form_strip([geometry[k] for k in chain.models], chain.joints) for chain in chains]
    for gap in gaps:
        context.warn(f"{_place(block, gap)}: {gap.reason}")
    context.log(f"{len(chains)} free strips: {', '.join(free_strip_ids(block, chains)[:20])}")
    return strips_of(block, models, chains, formed, gaps)


def _joined(
    block: Block, models: Models, run: Chain, geometry: list[Model], options: ScaleTransferOptions, context: Context
) -> tuple[list[Chain], list[Gap]]:
    """Join a run of neighbouring models, splitting it where the connection is too weak."""
    chain = Chain(run.strip, run.images[:2], run.models[:1])
    chains, gaps = [chain], []
    for k, (before, model) in enumerate(zip(run.models[:-1], run.models[1:])):
        image, following = run.images[k + 1], run.images[k + 2]
        names = f"{models.orientations.id[before]} and {models.orientations.id[model]}"
        joint = _joint(geometry[before], geometry[model], options)
        if joint is None or joint.active.sum() < options.min_connection_points:
            usable = 0 if joint is None else int(joint.active.sum())
            reason = f"models {names} share {usable} usable points, {options.min_connection_points} are needed"
            gaps.append(Gap(run.strip, image, following, reason))
            chain = Chain(run.strip, [image, following], [model])
            chains.append(chain)
            continue
        for warning in _warnings(joint, options):
            context.warn(f"joint of {names} at image {block.images.id[image]}: {warning}")
        chain.models.append(model)
        chain.images.append(following)
        chain.joints.append(joint)
    return chains, gaps


def _joint(first: Model, second: Model, options: ScaleTransferOptions) -> Joint | None:
    if not len(common_points(first, second)[0]):
        return None
    return transfer(first, second, snooping_limit=options.snooping_limit)


def _warnings(joint: Joint, options: ScaleTransferOptions) -> list[str]:
    found, used = [], int(joint.active.sum())
    if not 1 / options.scale_jump <= joint.scale <= options.scale_jump:
        found.append(f"the scale jumps by a factor of {joint.scale:.3g}: change of height, or wrong points")
    if used < CHECKED_POINTS:
        found.append(f"only {used} connection points: a wrong one cannot be located")
    worst = float(np.nan_to_num(joint.test[joint.active]).max(initial=0.0))
    if worst > options.snooping_limit:
        found.append(f"the scales of the connection points disagree by {worst:.1f} standard deviations")
    if used >= CHECKED_POINTS and joint.spread < UNSTABLE_SPREAD:
        found.append(f"bridge unstable: the connection points cover {joint.spread:.0%} of the width of the models")
    return found


def _place(block: Block, gap: Gap) -> str:
    strip = f"strip {block.strips.id[gap.strip]}" if gap.strip >= 0 else "no strip"
    images = " - ".join(str(block.images.id[row]) for row in (gap.left, gap.right) if row >= 0)
    return f"{strip}, {images}"
