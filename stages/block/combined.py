"""Files of other programs, one or several, as one block: image points of one, control of another, positions of a third.

Each source is recognised by its content (`aatri formats` lists the formats) or names its `format`. The first that has
images says which there are; the others are joined to it by the names of images, points and cameras: the same name, else
without folder, extension, or case, if that leaves no choice. What matches nothing is left out by name. All coordinates
are brought into one frame. A measured value comes before a start value; two that contradict each other are an error.
"""

import math
from typing import Any

from pydantic import model_validator

from aatri.artifacts.block import Block
from aatri.formats.parts.assembled import NotStated, assembled
from aatri.formats.parts.format import Reading
from aatri.formats.registry.sources import read_source, stated_frame
from aatri.plugin import SILENT, Context, Field, InputPath, stage

from ._as_read import ReadingOptions, as_read


class SourceOptions(Reading):
    """One source: its path, and what its files do not say."""

    path: InputPath = Field(description="file or folder")
    geoid: InputPath | None = Field(
        None, description="grid of the geoid above which its heights are, .tif or .gtx; null: as `vertical` says"
    )
    format: str | None = Field(None, description="a name of `aatri formats`; null: recognised by the content")

    @model_validator(mode="before")
    @classmethod
    def _path_alone(cls, value: Any) -> Any:
        return {"path": value} if isinstance(value, str) else value


class CombinedOptions(ReadingOptions):
    """Options of block/combined."""

    sources: tuple[SourceOptions, ...] = Field(
        min_length=1, description="files and folders: a path, or `{path: ..., format: ..., crs: ...}`"
    )
    name: str = Field("", description="name of the block; empty: that of the first source")
    crs: str | None = Field(
        None,
        description="coordinate system of the block; null: of the control, else of the positions, else of the rest",
    )
    vertical: str | None = Field(None, description="its height system; null: as `crs`, ellipsoidal where that is flat")
    image_sigma_px: float = Field(1.0, gt=0, description="standard deviation of image coordinates without one, px")
    image_sigma_um: float = Field(
        5.0, gt=0, description="the same of photo coordinates in mm, where pixels have no known size, um"
    )
    control_sigma: tuple[float, float, float] = Field(
        (0.0, 0.0, 0.0), description="standard deviations of control without any, m; 0: exact"
    )
    position_sigma: tuple[float, float, float] | None = Field(
        None, description="of measured positions without any, m; null: such positions are start values"
    )
    attitude_sigma_deg: float | None = Field(None, gt=0, description="of measured attitudes without any, degrees")
    calibrate: bool = Field(False, description="c, principal point and distortion are unknown and free, not fixed")


@stage(version=1, uses=())
def combined(*, options: CombinedOptions, context: Context = SILENT) -> Block:
    """Read sources and join them."""
    parts = [read_source(s.path, s, context, format=s.format, geoid=s.geoid) for s in options.sources]
    attitude = options.attitude_sigma_deg
    not_stated = NotStated(
        image_sigma_px=options.image_sigma_px,
        image_sigma_um=options.image_sigma_um,
        control_sigma_m=options.control_sigma,
        position_sigma_m=options.position_sigma,
        attitude_sigma_rad=None if attitude is None else math.radians(attitude),
        calibrate=options.calibrate,
        frame=stated_frame(options.crs, options.vertical),
    )
    block = assembled(parts, not_stated, name=options.name, reporter=context)
    return as_read(block, options, context)
