"""block.yaml: what a block is, as validated settings.

The models are the contract: keys, types, units and defaults. Values stay in the units of the file; `Units` has the
factors to the inner ones.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from aatri.formats.limits import MOST_UNDULATION_M
from aatri.formats.tables.settings.camera import CameraSettings, Rig
from aatri.formats.tables.settings.sections import Positive, ThreeSigmas, YamlSection
from aatri.units import ANGLE_RAD, LENGTH_M, LENGTH_MM, TIME_S

AXES = ({"east", "north", "up"}, {"x", "y", "z"}, {"latitude", "longitude", "height"})
"""Names of the axes of a frame; a frame has those of one set, in the order of its tables."""


def _word(value: Any) -> Any:
    """`true` without quotes is a truth value in YAML."""
    return "true" if value is True else value


class FrameSettings(YamlSection):
    """A coordinate frame: axes in the order of X, Y, Z in the tables."""

    axes: Annotated[list[str], Field(min_length=3, max_length=3)]
    crs: str = "local"
    vertical: str = ""

    @model_validator(mode="after")
    def _known_axes(self) -> FrameSettings:
        if set(self.axes) not in AXES:
            raise ValueError("axes must be east, north, up or x, y, z or latitude, longitude, height, in any order")
        return self


class Units(YamlSection):
    """Units of the tables."""

    ground: Literal["m", "dm", "cm", "mm", "km"] = "m"
    angle: Literal["deg", "gon", "rad", "dms"] | None = None
    sigma_image: Literal["um", "mm", "px"] = "um"
    sigma_ground: Literal["m", "cm", "mm"] = "m"
    sigma_angle: Literal["deg", "gon", "rad", "mgon", "arcsec"] | None = None
    time: Literal["s", "ms"] = "s"

    @property
    def ground_m(self) -> float:
        """Factor of coordinates."""
        return LENGTH_M[self.ground]

    @property
    def sigma_ground_m(self) -> float:
        """Factor of standard deviations of coordinates."""
        return LENGTH_M[self.sigma_ground]

    @property
    def time_s(self) -> float:
        """Factor of times."""
        return TIME_S[self.time]

    @property
    def sigma_angle_rad(self) -> float | None:
        """Factor of standard deviations of angles; None if the file does not say."""
        return ANGLE_RAD[self.sigma_angle] if self.sigma_angle else None

    def sigma_image_mm(self, pixel_size_mm: float) -> float:
        """Factor of standard deviations on the image."""
        return pixel_size_mm if self.sigma_image == "px" else LENGTH_MM[self.sigma_image]


class DefaultSigmas(YamlSection):
    """Standard deviations where a cell is empty, in the units of `units`; None where a cell must not be empty."""

    image: Positive | None = None
    fiducial: Positive | None = None
    control: ThreeSigmas | None = None
    position: ThreeSigmas | None = None
    attitude: ThreeSigmas | None = None


class Settings(YamlSection):
    """block.yaml."""

    aatri_block: Literal[1]
    name: str = ""
    frames: Annotated[dict[str, FrameSettings], Field(min_length=1)]
    earth_curvature: Literal["correct", "ignore", "frame"] | None = None
    undulation: Annotated[float, Field(ge=-MOST_UNDULATION_M, le=MOST_UNDULATION_M)] | None = None
    units: Units = Units()
    rotation: Literal["omega-phi-kappa", "phi-omega-kappa", "roll-pitch-heading"] | None = None
    heading: Annotated[Literal["true", "grid"], BeforeValidator(_word)] | None = None
    sigma: DefaultSigmas = DefaultSigmas()
    terrain_height: float | None = None
    cameras: dict[str, CameraSettings] = Field(default_factory=dict)
    rigs: dict[str, Rig] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _consistent(self) -> Settings:
        if self.heading and self.rotation != "roll-pitch-heading":
            raise ValueError("heading belongs to rotation: roll-pitch-heading")
        return self
