"""Pair files (.dat) of student programs: interior elements and point pairs, a file for each model of a strip.

The form of the files is described in docs/formats.md. The files hold no standard deviations: they are options.
"""

from aatri.artifacts.block import Block
from aatri.formats.pairs.reader import read_pairs
from aatri.plugin import SILENT, Context, Field, InputPath, stage

from ._as_read import ReadingOptions, as_read


class PairsOptions(ReadingOptions):
    """Options of block/pairs."""

    path: InputPath = Field(description="folder of the pair files, *.dat, in the order of the strip")
    unit_um: float = Field(1000.0, gt=0, description="unit of the photo coordinates, um: 1000 for mm, 0.1 ...")
    control: InputPath | None = Field(None, description="control points: point X Y Z, m; null: none")
    check: InputPath | None = Field(None, description="check points: point X Y Z, m; null: none")
    image_sigma_um: float = Field(10.0, gt=0, description="standard deviation of image coordinates, um")
    control_sigma: float | None = Field(None, gt=0, description="standard deviation of control points, m; null: exact")


@stage(version=1, uses=())
def pairs(*, options: PairsOptions, context: Context = SILENT) -> Block:
    """Read a folder of pair files."""
    block = read_pairs(
        options.path,
        unit_um=options.unit_um,
        image_sigma_um=options.image_sigma_um,
        control=options.control,
        check=options.check,
        control_sigma_m=options.control_sigma or 0.0,
        reporter=context,
    )
    return as_read(block, options, context)
