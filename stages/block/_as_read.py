"""What all readers of a block share: edits that are applied to it, and how much of it may be unusable."""

import numpy as np

from aatri.arrays import Text
from aatri.artifacts.block import Block
from aatri.checks.as_read.screening import REJECT_SHARE, screened
from aatri.checks.limits import MAX_REJECT_SHARE
from aatri.formats.edits.edited import edited
from aatri.plugin import Context, Field, InputPath, Options


class EditOptions(Options):
    """Option of every block that is read."""

    edits: InputPath | None = Field(
        None, description="file of edits (`aatri edit`); null: edits.yaml of a block folder, where it has one"
    )


class ReadingOptions(EditOptions):
    """Options of a block of which a part may be unusable."""

    max_reject_share: float = Field(MAX_REJECT_SHARE, ge=0, le=1, description=REJECT_SHARE)


def as_read(
    block: Block, options: ReadingOptions, context: Context, *, copies: bool = False, elsewhere: Text | None = None
) -> Block:
    """The block with its edits, what cannot be used set aside; `elsewhere`: points that other blocks show too."""
    block = edited(block, options.edits, context)
    shared = None if elsewhere is None else np.isin(block.points.id, elsewhere)
    return screened(block, context, options.max_reject_share, copies=copies, elsewhere=shared)
