"""Block folder: block.yaml and CSV tables, the native input.

Reads images, measured image points and fiducials, ground points with a role per coordinate, exterior and geodetic
observations and relative control; checks everything before saying anything; turns it into metres, millimetres,
radians and right-handed axes; sets aside, by name and with the reason, what cannot be used. The folder is described
in docs/formats.md.
"""

from aatri.artifacts.block import Block
from aatri.checks.as_read.screening import REJECT_SHARE, screened
from aatri.checks.limits import MAX_REJECT_SHARE
from aatri.formats.tables.reader import read_block
from aatri.plugin import SILENT, Context, Field, InputPath, Options, stage


class TablesOptions(Options):
    """Options of block/tables."""

    path: InputPath = Field(description="the block folder")
    max_reject_share: float = Field(MAX_REJECT_SHARE, ge=0, le=1, description=REJECT_SHARE)


@stage(version=1, uses=())
def tables(*, options: TablesOptions, context: Context = SILENT) -> Block:
    """Read a block folder."""
    return screened(read_block(options.path, context), context, options.max_reject_share)
