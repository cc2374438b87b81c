"""Block folder: block.yaml and CSV tables, the native input.

Reads images, measured image points and fiducials, ground points with a role per coordinate, exterior and geodetic
observations and relative control; checks everything before saying anything; turns it into metres, millimetres,
radians and right-handed axes; sets aside, by name and with the reason, what cannot be used. The folder is described
in docs/formats.md.
"""

from aatri.artifacts.block import Block
from aatri.formats.tables.reader import read_block
from aatri.formats.tables.source import EDITS
from aatri.plugin import SILENT, Context, Field, InputPath, stage

from ._as_read import ReadingOptions, as_read


class TablesOptions(ReadingOptions):
    """Options of block/tables."""

    path: InputPath = Field(description="the block folder")


@stage(version=1, uses=())
def tables(*, options: TablesOptions, context: Context = SILENT) -> Block:
    """Read a block folder."""
    own = options.path / EDITS
    if options.edits is None and own.exists():
        options = options.model_copy(update={"edits": own})
    return as_read(read_block(options.path, context), options, context)
