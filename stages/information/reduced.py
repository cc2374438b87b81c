"""Helmert's blocks: the normal equations of a block, reduced onto the unknowns that it shares with others.

    N = N11 - N12 N22^-1 N21,    g = g1 - N12 N22^-1 g2            1 shared, 2 of this block alone

The block is adjusted, and everything eliminated but the images and points that `keep` names or the block `other` has
too, and the parameters of cameras and drifts. Given to the bundle of another block (`information`), N and g stand for
all observations of this one: the result is that of both in one, at the place of linearisation. Where that is this
block's own adjustment the difference is of second order in the change of the shared unknowns; with the `information`
of the others this block is linearised at the adjustment of all, and a second round has no difference left.

An image or point that the other has too, and this block alone does not determine (a point of one ray), stays all the
same, linearised at its start: the equations are singular then, and regular with those of the other.

With `include` the Information it was adjusted with is passed on within its own: parts of a block, one after the other.
What that has and this block has not stays in it, for those that come after. `at_initial` linearises where all blocks
together are, though this one is adjusted with some of them.

Source: Helmert 1880; Wolf 1978, The Helmert block method.
"""

import numpy as np

from aatri.adapters.bundle.information_of import information_of
from aatri.adapters.bundle.information_sum import added
from aatri.arrays import Bool, Text
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.information import Information
from aatri.artifacts.solution import Solution
from aatri.checks.as_read.screening import SEEN_ONCE
from aatri.errors import InputError
from aatri.ids import matching, several, shown
from aatri.observations.poses import POINT, POSE
from aatri.orientation.bundle.shared_equations import shared_equations
from aatri.plugin import SILENT, Context, Field, Options, stage

# relative: type checkers know stages by their folder
from ..bundle_adjustment._adjusted import adjusted_bundle  # noqa: TID252
from ..bundle_adjustment._self_calibration import camera_tables  # noqa: TID252
from ..bundle_adjustment.bundle import BundleOptions, bundle_needs, bundle_uses  # noqa: TID252


class KeepOptions(Options):
    """What stays, beside what the block `other` has too."""

    images: list[str] = Field([], description="ids of images, with * and ?")
    points: list[str] = Field([], description="ids of points, with * and ?")


class ReducedOptions(BundleOptions):
    """Options of the bundle, and what stays."""

    keep: KeepOptions = Field(KeepOptions(), description="images and points whose unknowns stay")
    include: bool = Field(False, description="pass on the Information that the block is adjusted with, in its own")
    at_initial: bool = Field(
        False, description="linearise at `initial`, the result of all blocks, not where this one is"
    )


@stage(version=1, uses=bundle_uses, needs=bundle_needs)
def reduced(
    block: Block,
    image_points: ImagePoints | None = None,
    initial: Solution | None = None,
    calibration: Solution | None = None,
    information: Information | None = None,
    other: Block | None = None,
    *,
    options: ReducedOptions = ReducedOptions(),
    context: Context = SILENT,
) -> Information:
    """Adjust the block and reduce its normal equations."""
    adjusted = adjusted_bundle(block, image_points, initial, calibration, information, options, context)
    requested = {
        POSE: _chosen("image", block.images.id, options.keep.images, other.images.id if other else None),
        POINT: _chosen("point", block.points.id, options.keep.points, other.points.id if other else None),
    }
    included = information if options.include else None
    in_both = (
        requested
        if included is None
        else {
            group: chosen | np.isin(ids, included.unknowns.object[included.unknowns.group == group])
            for (group, chosen), ids in zip(requested.items(), (block.images.id, block.points.id))
        }
    )
    start, at_start = adjusted.source.start, options.at_initial and initial is not None
    at = (start[POSE], start[POINT]) if at_start else None
    equations = shared_equations(adjusted.done, in_both, at)
    _tell_rays_set_aside(block, requested[POINT], context)
    _tell_lost_rays(block, requested[POINT] & ~equations.keep[POINT], context)
    if not any(kept.any() for kept in equations.keep.values()):
        raise InputError(
            "nothing stays: no adjusted image or point is one of another block",
            where=f"block {block.name}",
            remedy="connect `other`, the block it is for, or name images and points under `keep`",
        )
    tables, _ = camera_tables(block, adjusted.done.result, adjusted.chosen)
    made = information_of(adjusted.source, adjusted.done, equations, tables.sets)
    if included is not None:
        staying = {
            (group, name)
            for group, ids in zip(requested, (block.images.id, block.points.id))
            for name in ids[requested[group]].tolist()
        }
        made = added(made, included, lambda group, name: (group, name) in staying)
    context.log(", ".join(f"{count} {name}" for name, count in made.metrics().items()))
    return made


def _tell_rays_set_aside(block: Block, requested: Bool, context: Context) -> None:
    """Image points of shared points that were set aside as the block was read: it alone has one of each."""
    rows = np.flatnonzero((block.rejects.kind == "image_point") & (block.rejects.reason == SEEN_ONCE))
    names, shared = block.rejects.id[rows].tolist(), set(block.points.id[requested].tolist())
    lost = [name for name in names if name.partition("/")[2] in shared]
    if lost:
        context.warn(
            f"of shared points {several(len(lost), 'image point', 'was', 'were')} set aside as the block was read "
            f"({SEEN_ONCE}): {shown(lost)}; cut the block out of the merged one (block/part), which keeps them"
        )


def _tell_lost_rays(block: Block, left_out: Bool, context: Context) -> None:
    """Image points of shared points in images without orientation say nothing of the others."""
    m = block.image_points
    rays = np.bincount(m.point[m.active], minlength=len(block.points)) * left_out
    if rays.any():
        lost = f"lost: {several(int(rays.sum()), 'image point')} of {several(int((rays > 0).sum()), 'shared point')}"
        names = shown(block.points.id[rays > 0].tolist())
        context.warn(f"{lost}, no image that shows the points is adjusted: {names}; give those images a start")


def _chosen(kind: str, ids: Text, patterns: list[str], of_other: Text | None) -> Bool:
    """What matches a pattern, or the other block has too."""
    chosen = matching(kind, ids, patterns, where="keep")
    return chosen if of_other is None else chosen | np.isin(ids, of_other)
