"""Cameras of block.yaml, and rigs of them: keys, types, units and defaults."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, model_validator

from aatri.formats.tables.settings.sections import (
    FaultAt,
    FreeSigma,
    Positive,
    Three,
    ThreeFreeSigmas,
    Two,
    TwoPositive,
    YamlSection,
)
from aatri.ids import clipped, did_you_mean, several

PARAMETERS = {
    "none": (),
    "table": (),
    "brown": ("k1", "k2", "k3", "p1", "p2", "b1", "b2"),
    "opencv": ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
    "polynomial": ("k1", "k2", "k3", "k4", "k5", "k6", "k7", "p1", "p2", "a1", "a2", "b2"),
    "fisheye": ("k1", "k2", "k3", "k4"),
    "bal": ("k1", "k2"),
    "dbat3": ("as", "k1", "k2", "k3", "p1", "p2"),
}
"""Parameters of the distortion models."""

VECTORS = {"principal_point": "xy", "symmetry_point": "xy", "lever_arm": "xyz", "boresight": "xyz"}
"""Camera parameters of several components; a component is called `principal_point.x`."""


def _zeros(n: int) -> Any:
    """The default of a field: a list of n zeros."""
    return Field(default_factory=lambda: [0.0] * n)


class Pixel(YamlSection):
    """Size in mm, origin and y direction of pixel coordinates."""

    size: TwoPositive
    origin: Literal["top-left-corner", "top-left-centre", "bottom-left-corner", "image-centre"] | None = None
    y: Literal["down", "up"] | None = None


class DistortionSettings(YamlSection):
    """Distortion model with its parameters."""

    model: Literal["none", "brown", "table", "opencv", "polynomial", "fisheye", "bal", "dbat3"]
    parameters: dict[str, float] = Field(default_factory=dict)
    radius: list[Annotated[float, Field(ge=0)]] = Field(default_factory=list)
    correction: list[float] = Field(default_factory=list)

    @model_validator(mode="before")
    @classmethod
    def _collect(cls, value: Any) -> Any:
        """Gather the parameters of the model, which stand beside its name."""
        if not isinstance(value, dict) or str(value.get("model")) not in PARAMETERS:
            return value
        names = PARAMETERS[value["model"]]
        rest = {key: item for key, item in value.items() if key not in names}
        return rest | {"parameters": {key: value[key] for key in names if key in value}}

    @model_validator(mode="after")
    def _table(self) -> DistortionSettings:
        if len(self.radius) != len(self.correction):
            raise ValueError(f"{len(self.radius)} radii, but {several(len(self.correction), 'correction')}")
        if (self.model == "table") != bool(self.radius):
            raise ValueError("radius and correction belong to the model `table`, and it needs them")
        if sorted(set(self.radius)) != self.radius:
            raise ValueError("radii must ascend")
        return self


class CameraSettings(YamlSection):
    """A camera."""

    kind: Literal["film", "digital"]
    image_coordinates: Literal["photo", "comparator", "pixel"]
    pixel: Pixel | None = None
    format: TwoPositive | None = None
    principal_distance: Positive
    principal_point: Two = _zeros(2)
    symmetry_point: Two = _zeros(2)
    fiducials: dict[str, Two] = Field(default_factory=dict)
    distortion: DistortionSettings = DistortionSettings(model="none")
    sigmas: dict[str, FreeSigma | list[FreeSigma]] = Field(default_factory=dict)
    lever_arm: Three = _zeros(3)
    boresight: Three = _zeros(3)
    mount: Literal[0, 90, 180, 270] = 0

    @model_validator(mode="after")
    def _consistent(self) -> CameraSettings:
        if self.image_coordinates == "pixel":
            if self.pixel is None or self.pixel.origin is None or self.pixel.y is None:
                raise ValueError("image_coordinates: pixel needs pixel: {size: ..., origin: ..., y: ...}")
            if self.format is None and self.pixel.origin != "image-centre":
                raise ValueError("image_coordinates: pixel needs format: [columns, rows]")
        names = ["principal_distance", *VECTORS, *PARAMETERS[self.distortion.model]]
        for name, sigma in self.sigmas.items():
            if name not in names:
                raise FaultAt(f"unknown parameter {clipped(name)!r}{did_you_mean(name, names)}", "sigmas", name)
            if isinstance(sigma, list) and len(sigma) != len(VECTORS.get(name, "x")):
                raise FaultAt(f"takes {len(VECTORS.get(name, 'x'))} values, not {len(sigma)}", "sigmas", name)
        return self


class RigMemberSigmas(YamlSection):
    """Standard deviations of the place of a rig member: 0 fixed, .inf free, else weighted."""

    position: ThreeFreeSigmas = _zeros(3)
    angles: ThreeFreeSigmas = _zeros(3)


class RigMemberSettings(YamlSection):
    """A camera of a rig: projection centre (m) and omega, phi, kappa in the camera axes of the first member."""

    position: Three = _zeros(3)
    angles: Three = _zeros(3)
    sigmas: RigMemberSigmas = RigMemberSigmas()


def check_rig(rig: dict[str, RigMemberSettings]) -> dict[str, RigMemberSettings]:
    """A rig has members, and the first one is its frame.

    Raises
    ------
    ValueError
        If it has none, or places the first.
    """
    if not rig:
        raise ValueError("a rig needs members: {nadir: {}, oblique: {position: ..., angles: ...}}")
    first, settings = next(iter(rig.items()))
    if settings != RigMemberSettings():
        raise ValueError(f"the first member, {clipped(first)}, is the frame of the rig: it takes no position, angles")
    return rig


Rig = Annotated[dict[str, RigMemberSettings], AfterValidator(check_rig)]
