"""Files of other programs, one or several, as one block: image points of one, control of another, positions of a third.

Each source is recognised by its content (`aatri formats` lists the formats) or names its `format`. The first that has
images says which there are; the others are joined to it by the names of images, points and cameras: the same name, else
without folder, extension, or case, if that leaves no choice. What matches nothing is left out by name. All coordinates
are brought into one frame. A measured value comes before a start value; two that contradict each other are an error.
"""

from typing import Any

from pydantic import model_validator

from aatri.artifacts.block import Block
from aatri.formats.parts.assembled import assembled
from aatri.formats.parts.format import CONTROL_FILE, GEOID, Reading
from aatri.formats.parts.not_stated import NotStated
from aatri.formats.registry.sources import read_source
from aatri.plugin import SILENT, Context, Field, InputPath, stage

from ._as_read import ReadingOptions, as_read


class SourceOptions(Reading):
    """One source: its path, and what its files do not say."""

    path: InputPath = Field(description="file or folder")
    geoid: InputPath | None = Field(None, description=GEOID)
    control: InputPath | None = Field(None, description=CONTROL_FILE)

    @model_validator(mode="before")
    @classmethod
    def _path_alone(cls, value: Any) -> Any:
        return {"path": value} if isinstance(value, str) else value


class CombinedOptions(ReadingOptions, NotStated):
    """Options of block/combined."""

    sources: tuple[SourceOptions, ...] = Field(
        min_length=1, description="files and folders: a path, or `{path: ..., format: ..., crs: ...}`"
    )


@stage(version=1, uses=())
def combined(*, options: CombinedOptions, context: Context = SILENT) -> Block:
    """Read sources and join them."""
    parts = [read_source(s.path, s, context) for s in options.sources]
    return as_read(assembled(parts, options, reporter=context), options, context)
