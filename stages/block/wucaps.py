"""WuCAPS files: camera, image coordinates, ground points and roles of the Chinese block adjustment system.

The first points of PRECPI are control (full, plan-only, height-only), the rest check points. The files hold no
standard deviations: they are options. The form of the files is described in docs/formats.md.
"""

from aatri.artifacts.block import Block
from aatri.checks.as_read.screening import REJECT_SHARE, screened
from aatri.checks.limits import MAX_REJECT_SHARE
from aatri.formats.wucaps.reader import read_wucaps
from aatri.plugin import SILENT, Context, Field, InputPath, Options, stage


class WucapsOptions(Options):
    """Options of block/wucaps."""

    path: InputPath = Field(description="folder with PRECAI, PREPHI, PRECKI and PRECPI")
    image_sigma_um: float = Field(10.0, gt=0, description="standard deviation of image coordinates, um")
    control_sigma: float | None = Field(None, gt=0, description="standard deviation of control points, m; null: exact")
    max_reject_share: float = Field(MAX_REJECT_SHARE, ge=0, le=1, description=REJECT_SHARE)


@stage(version=1, uses=())
def wucaps(*, options: WucapsOptions, context: Context = SILENT) -> Block:
    """Read a folder of WuCAPS files."""
    block = read_wucaps(
        options.path,
        image_sigma_mm=options.image_sigma_um * 1e-3,
        reporter=context,
        control_sigma_m=options.control_sigma,
    )
    return screened(block, context, options.max_reject_share)
