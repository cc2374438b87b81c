"""WuCAPS files: camera, image coordinates, ground points and roles of the Chinese block adjustment system.

The first points of PRECPI are control (full, plan-only, height-only), the rest check points. The files hold no
standard deviations: they are options. The form of the files is described in docs/formats.md.
"""

from aatri.artifacts.block import Block
from aatri.formats.wucaps.reader import read_wucaps
from aatri.plugin import SILENT, Context, Field, InputPath, stage

from ._as_read import ReadingOptions, as_read


class WucapsOptions(ReadingOptions):
    """Options of block/wucaps."""

    path: InputPath = Field(description="folder with PRECAI, PREPHI, PRECKI and PRECPI")
    image_sigma_um: float = Field(10.0, gt=0, description="standard deviation of image coordinates, um")
    control_sigma: float | None = Field(None, gt=0, description="standard deviation of control points, m; null: exact")


@stage(version=1, uses=())
def wucaps(*, options: WucapsOptions, context: Context = SILENT) -> Block:
    """Read a folder of WuCAPS files."""
    block = read_wucaps(
        options.path,
        image_sigma_mm=options.image_sigma_um * 1e-3,
        reporter=context,
        control_sigma_m=options.control_sigma,
    )
    return as_read(block, options, context)
