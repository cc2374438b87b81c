"""What is said of a block of several sources that no file says: its frame and standard deviations."""

from collections.abc import Mapping, Sequence
from typing import Any, Self

from pydantic import Field

from aatri.errors import InputError
from aatri.formats.parts.block_parts import BlockParts
from aatri.frames.checks import fault_of_frame
from aatri.frames.conversion import Frame
from aatri.options import Options


class NotStated(Options):
    """Options of a block of several sources."""

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

    def beside(self, of_sources: Sequence[Mapping[str, Any]]) -> Self:
        """With what sources say for rows of others, the first source first; what was said here obeys."""
        values = {name: value for one in reversed(of_sources) for name, value in one.items()}
        return self.model_copy(update={k: v for k, v in values.items() if k not in self.model_fields_set})

    def origin(self, name: str, sources: Sequence[BlockParts]) -> str:
        """What says an option: the file of a source, where it is not said here."""
        files = [] if name in self.model_fields_set else [p.files[0] for p in sources if name in p.not_stated]
        return f"as {files[0]} says" if files else f"`{name}`"


DEFAULTS = NotStated()


def stated_frame(crs: str | None, vertical: str | None, where: str = "") -> Frame | None:
    """The frame of a coordinate system and a height system; None where there is neither.

    Raises
    ------
    InputError
        If pyproj does not know one of them, or it does not count in metres or degrees.
    """
    if crs is None and vertical is None:
        return None
    frame = Frame("map", _axes(crs or "local"), crs or "local", vertical or "")
    if fault := fault_of_frame(frame):
        key, what, remedy = fault
        raise InputError(f"{key}: {what}", where=where, remedy=remedy)
    return frame


def _axes(crs: str) -> tuple[str, ...]:
    from aatri.frames.crs_text import crs_from

    try:
        system = crs_from(crs)
    except Exception:  # of pyproj; told as a fault of the frame
        return ("east", "north", "up")
    if system.is_geocentric:
        return ("x", "y", "z")
    return ("longitude", "latitude", "height") if system.is_geographic else ("east", "north", "up")
