"""Bundle Adjustment in the Large: a problem file as a block.

Reads image points, start values of orientations and points, and a camera per image with f, k1, k2. A pixel is taken as
0.001 mm. Image points of points behind their camera stay active. The form of the file is described in docs/formats.md.
"""

from aatri.artifacts.block import Block
from aatri.formats.bal.problem import read_bal
from aatri.plugin import SILENT, Context, Field, InputPath, stage

from ._as_read import ReadingOptions, as_read


class BalOptions(ReadingOptions):
    """Options of block/bal."""

    path: InputPath = Field(description="the problem, an unpacked text file")
    image_sigma_px: float = Field(1.0, gt=0, description="standard deviation of image coordinates, px")
    calibrate: bool = Field(True, description="f, k1 and k2 of every image are unknown and free, not fixed")


@stage(version=1, uses=())
def bal(*, options: BalOptions, context: Context = SILENT) -> Block:
    """Read a problem file."""
    block = read_bal(
        options.path,
        image_sigma_px=options.image_sigma_px,
        calibrate=options.calibrate,
        reporter=context,
    )
    return as_read(block, options, context, copies=True)
