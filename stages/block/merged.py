"""Several blocks as one: ids matched, what is in more than one counted once, contradictions told by name.

Images, points, cameras and strips of one id are the same thing. Equal rows count once. Two measurements of one thing
(an image point, given coordinates, a position) are averaged where they agree,

    x = P^-1 (P1 x1 + P2 x2),    P = P1 + P2,    Pi = Ci^-1

and refused by name where they differ by more than six standard deviations of their difference; so is a camera, a
strip or a role that is another in two blocks. All blocks are in one frame. A block that brings nothing new, or has
nothing in common with the others, is refused. Ids that mean other things in another block get a prefix or other names.

Source: lecture notes A1604 (common points averaged and checked against a tolerance); Mikhail & Ackermann 1976.
"""

from pathlib import Path
from typing import Any

from pydantic import model_validator

from aatri.artifacts.block import Block
from aatri.checks.as_read.screening import FEW_POINTS, OUTSIDE, REJECTED_IMAGE, SEEN_ONCE
from aatri.checks.limits import SAME_POINT_SIGMAS
from aatri.errors import InputError
from aatri.formats.merging.merged import merged as merged_blocks
from aatri.formats.merging.names import RenamingOptions, renamed
from aatri.formats.merging.rows import Conflicts, Duplicates
from aatri.formats.merging.source import SUFFIX, block_from
from aatri.formats.parts.assembled import assembled
from aatri.formats.parts.format import Reading
from aatri.formats.registry.recognised import recognised_file
from aatri.formats.registry.sources import read_source
from aatri.plugin import SILENT, Context, Field, InputPath, stage

from ._as_read import ReadingOptions, as_read

OF_PARTS = frozenset({OUTSIDE, SEEN_ONCE, REJECTED_IMAGE, FEW_POINTS})
"""Reasons to set something aside that hold for a block as it stood alone."""


class SingleBlockOptions(RenamingOptions):
    """One block, and how its ids are to be read."""

    path: InputPath = Field(
        description="block folder, the Block of another run (runs/NAME/current/block.h5), or a file or folder of a "
        "format that has a stage of its own (`gama`, `colmap` ...)"
    )
    crs: str | None = Field(None, description="coordinate system of a file of another format that names none")
    vertical: str | None = Field(None, description="its height system; null: as it says, or ellipsoidal")

    @model_validator(mode="before")
    @classmethod
    def _path_alone(cls, value: Any) -> Any:
        return {"path": value} if isinstance(value, str | Path) else value


class MergedOptions(ReadingOptions):
    """Options of block/merged."""

    blocks: tuple[SingleBlockOptions, ...] = Field(
        min_length=2, description="folders and artifacts: a path, or `{path: ..., prefix: ..., rename: ...}`"
    )
    name: str = Field("", description="name of the block; empty: those of the blocks")
    duplicates: Duplicates = Field(
        "average", description="two measurements of one thing that agree: their mean, the first, or an error"
    )
    conflicts: Conflicts = Field(
        "refuse", description="values that exclude each other: an error, or those of the first with a warning"
    )
    unconnected: bool = Field(False, description="blocks without a common image or point may stand side by side")


@stage(version=1, uses=())
def merged(*, options: MergedOptions, context: Context = SILENT) -> Block:
    """Read blocks and merge them."""
    blocks = [renamed(_block(part, context), part) for part in options.blocks]
    block = merged_blocks(
        blocks,
        [str(part.path) for part in options.blocks],
        context,
        name=options.name,
        duplicates=options.duplicates,
        conflicts=options.conflicts,
        sigmas=SAME_POINT_SIGMAS,
        unconnected=options.unconnected,
    )
    return as_read(block, options, context)


def _block(part: SingleBlockOptions, context: Context) -> Block:
    """A block folder or an artifact, else what a format has that a stage of its own reads."""
    path = part.path
    own = path.suffix == SUFFIX or (path / "block.yaml").exists()
    if path.exists() and not own:
        declared = recognised_file(path).format
        if declared.stage and declared.read is not None:
            reading = Reading(crs=part.crs, vertical=part.vertical)
            return assembled([read_source(path, reading, context)], reporter=context)
    if path.exists() and own and (part.crs or part.vertical):
        remedy = "leave `crs` and `vertical` out; a block folder says them in block.yaml"
        raise InputError("says its coordinate system itself", where=str(path), remedy=remedy)
    return block_from(path, context, OF_PARTS)
