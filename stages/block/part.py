"""A part of another block: some images with all that is measured in them and observed of them.

Images are chosen by their ids, by their strips, or as those of a third block. Sights on the ground and conditions
that reach outside are left out and counted. Image points of points that images outside show too stay in use where one
image of the part alone shows them: `information/reduced` tells the others of them. `block/merged` makes the whole
again.
"""

import numpy as np

from aatri.artifacts.block import Block
from aatri.errors import InputError
from aatri.formats.merging.part import part_of
from aatri.formats.merging.source import block_from
from aatri.ids import matching, several
from aatri.plugin import SILENT, Context, Field, InputPath, stage

from ._as_read import ReadingOptions, as_read


class PartOptions(ReadingOptions):
    """Options of block/part."""

    path: InputPath = Field(description="block folder, or the Block of another run (runs/NAME/current/block.h5)")
    images: list[str] = Field([], description="ids of images, with * and ?")
    strips: list[str] = Field([], description="ids of strips, with * and ?: all their images")
    name: str = Field("", description="name of the part; empty: that of the block")


@stage(version=1, uses=())
def part(*, options: PartOptions, context: Context = SILENT) -> Block:
    """Read a block and cut a part out."""
    block = block_from(options.path, context)
    strips = matching("strip", block.strips.id, options.strips)
    images = matching("image", block.images.id, options.images) | np.append(strips, False)[block.images.strip]
    if not images.any():
        raise InputError("no image is chosen", where=str(options.path), remedy="give `images` or `strips`")
    cut = part_of(block, images)
    context.log(f"{len(cut.images)} of {len(block.images)} images, {len(cut.points)} of {len(block.points)} points")
    left_out = len(block.geodetic) - len(cut.geodetic), len(block.relative_control) - len(cut.relative_control)
    if any(left_out):
        context.log(
            f"outside: {several(left_out[0], 'geodetic observation')}, "
            f"{several(left_out[1], 'condition')} of relative control"
        )
    rays = block.image_points
    outside = np.unique(rays.point[rays.active & ~images[rays.image]])
    return as_read(cut, options, context, elsewhere=block.points.id[outside])
