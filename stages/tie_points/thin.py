"""Fewer tie points: long tracks first, spread over the cells of their images.

A point stays while at least two of its images have a cell with fewer than `per_cell` points: the Gruber positions of
every image and more. Images with no more than `least` points keep them all. Points of control stay whatever they are.

    sigma of an orientation ~ 1 / sqrt(points),   time of the adjustment ~ points

Source: Gruber 1924 (positions); docs/methods/tie_points.md.
"""

import numpy as np

from aatri.adapters.interior.image_pixels import cells_of, without_image_points
from aatri.artifacts.block import Block
from aatri.pixels.thinning import kept_points
from aatri.plugin import SILENT, Context, Field, Options, stage


class ThinOptions(Options):
    """Options of thinning."""

    cells: int = Field(8, ge=1, description="cells along each side of an image")
    per_cell: int = Field(2, ge=1, description="points that fill a cell")
    least: int = Field(50, ge=0, description="images with no more points than this keep them all")


@stage(version=1, uses=())
def thin(block: Block, *, options: ThinOptions = ThinOptions(), context: Context = SILENT) -> Block:
    """Thin out tie points."""
    points = block.image_points
    is_tie = np.ones(len(block.points), dtype=bool)
    is_tie[block.ground_points.point] = False
    tie = np.flatnonzero(is_tie[points.point] & points.active)
    kept = kept_points(
        points.point[tie],
        points.image[tie],
        cells_of(block, options.cells)[tie],
        points.sigma_mm[tie].max(axis=1),
        per_cell=options.per_cell,
        least=options.least,
    )
    context.log(f"{int(kept.sum())} of {len(tie)} image points of {len(np.unique(points.point[tie]))} tie points stay")
    removed = np.zeros(len(points), dtype=bool)
    removed[tie[~kept]] = True
    return without_image_points(block, removed)
