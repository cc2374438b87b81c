"""block.yaml: what a block is, as validated settings.

The models below are the contract: keys, types, units and defaults. Unknown keys are errors, keys that start with `x_`
are ignored. All faults are reported together, each with its place in the file. Values stay in the units of the file;
`Units` has the factors to the inner ones.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from aatri.errors import InputError, raise_all
from aatri.ids import did_you_mean, is_valid, printable
from aatri.strict_yaml import Document, load
from aatri.units import ANGLE_RAD, LENGTH_M, LENGTH_MM, TIME_S

AXES = ({"east", "north", "up"}, {"x", "y", "z"}, {"latitude", "longitude", "height"})
"""Names of the axes of a frame; a frame has those of one set, in the order of its tables."""

PARAMETERS = {
    "none": (),
    "table": (),
    "brown": ("k1", "k2", "k3", "p1", "p2", "b1", "b2"),
    "opencv": ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
    "fisheye": ("k1", "k2", "k3", "k4"),
    "bal": ("k1", "k2"),
}
"""Parameters of the distortion models."""

VECTORS = {"principal_point": "xy", "symmetry_point": "xy", "lever_arm": "xyz", "boresight": "xyz"}
"""Camera parameters of several components; a component is called `principal_point.x`."""


def _broadcast(value: Any) -> Any:
    return [value] * 3 if isinstance(value, int | float) and not isinstance(value, bool) else value


def _pair(value: Any) -> Any:
    return [value] * 2 if isinstance(value, int | float) and not isinstance(value, bool) else value


Positive = Annotated[float, Field(gt=0)]
Sigma = Annotated[float, Field(ge=0)]
Two = Annotated[list[float], Field(min_length=2, max_length=2)]
TwoPositive = Annotated[list[Positive], BeforeValidator(_pair), Field(min_length=2, max_length=2)]
Three = Annotated[list[float], Field(min_length=3, max_length=3)]
ThreeSigmas = Annotated[list[Sigma], BeforeValidator(_broadcast), Field(min_length=3, max_length=3)]
FreeSigma = Annotated[float, Field(ge=0, allow_inf_nan=True)]


class _Section(BaseModel):
    """A mapping of the file."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _without_own_keys(cls, value: Any) -> Any:
        if isinstance(value, dict):
            return {key: item for key, item in value.items() if not str(key).startswith("x_")}
        return value


class FrameSettings(_Section):
    """A coordinate frame: axes in the order of X, Y, Z in the tables."""

    axes: Annotated[list[str], Field(min_length=3, max_length=3)]
    crs: str = "local"
    vertical: str = ""

    @model_validator(mode="after")
    def _known_axes(self) -> FrameSettings:
        if set(self.axes) not in AXES:
            raise ValueError("axes must be east, north, up or x, y, z or latitude, longitude, height, in any order")
        return self


class Units(_Section):
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


class DefaultSigmas(_Section):
    """Standard deviations where a cell is empty, in the units of `units`; None where a cell must not be empty."""

    image: Positive | None = None
    fiducial: Positive | None = None
    control: ThreeSigmas | None = None
    position: ThreeSigmas | None = None
    attitude: ThreeSigmas | None = None


class Pixel(_Section):
    """Size in mm, origin and y direction of pixel coordinates."""

    size: TwoPositive
    origin: Literal["top-left-corner", "top-left-centre", "bottom-left-corner", "image-centre"] | None = None
    y: Literal["down", "up"] | None = None


class Distortion(_Section):
    """Distortion model with its parameters."""

    model: Literal["none", "brown", "table", "opencv", "fisheye", "bal"]
    parameters: dict[str, float] = {}
    radius: list[Annotated[float, Field(ge=0)]] = []
    correction: list[float] = []

    @model_validator(mode="before")
    @classmethod
    def _collect(cls, value: Any) -> Any:
        """Gather the parameters of the model, which stand beside its name."""
        if not isinstance(value, dict) or value.get("model") not in PARAMETERS:
            return value
        known = PARAMETERS[value["model"]]
        rest = {key: item for key, item in value.items() if key not in known}
        return rest | {"parameters": {key: value[key] for key in known if key in value}}

    @model_validator(mode="after")
    def _table(self) -> Distortion:
        if len(self.radius) != len(self.correction):
            raise ValueError(f"{len(self.radius)} radii, but {len(self.correction)} corrections")
        if (self.model == "table") != bool(self.radius):
            raise ValueError("radius and correction belong to the model `table`, and it needs them")
        if sorted(set(self.radius)) != self.radius:
            raise ValueError("radii must ascend")
        return self


class CameraSettings(_Section):
    """A camera."""

    kind: Literal["film", "digital"]
    image_coordinates: Literal["photo", "comparator", "pixel"]
    pixel: Pixel | None = None
    format: TwoPositive | None = None
    principal_distance: Positive
    principal_point: Two = [0.0, 0.0]
    symmetry_point: Two = [0.0, 0.0]
    fiducials: dict[str, Two] = {}
    distortion: Distortion = Distortion(model="none")
    sigmas: dict[str, FreeSigma | list[FreeSigma]] = {}
    lever_arm: Three = [0.0, 0.0, 0.0]
    boresight: Three = [0.0, 0.0, 0.0]

    @model_validator(mode="after")
    def _consistent(self) -> CameraSettings:
        if self.image_coordinates == "pixel":
            if self.pixel is None or self.pixel.origin is None or self.pixel.y is None:
                raise ValueError("image_coordinates: pixel needs pixel: {size: ..., origin: ..., y: ...}")
            if self.format is None and self.pixel.origin != "image-centre":
                raise ValueError("image_coordinates: pixel needs format: [columns, rows]")
        known = ["principal_distance", *VECTORS, *PARAMETERS[self.distortion.model]]
        for name, sigma in self.sigmas.items():
            if name not in known:
                raise ValueError(f"sigmas: unknown parameter {printable(name)!r}{did_you_mean(name, known)}")
            if isinstance(sigma, list) and len(sigma) != len(VECTORS.get(name, "x")):
                raise ValueError(f"sigmas: {name} takes {len(VECTORS.get(name, 'x'))} values, not {len(sigma)}")
        return self


class Settings(_Section):
    """block.yaml."""

    aatri_block: Literal[1]
    name: str = ""
    frames: Annotated[dict[str, FrameSettings], Field(min_length=1)]
    earth_curvature: Literal["correct", "ignore", "frame"] | None = None
    units: Units = Units()
    rotation: Literal["omega-phi-kappa", "phi-omega-kappa", "roll-pitch-heading"] | None = None
    sigma: DefaultSigmas = DefaultSigmas()
    terrain_height: float | None = None
    cameras: dict[str, CameraSettings] = {}

    @model_validator(mode="after")
    def _first_frame(self) -> Settings:
        frame = next(iter(self.frames.values()))
        if "latitude" in frame.axes:
            raise ValueError("the first frame must have east, north, up or x, y, z axes in metres, not latitude")
        return self


def read_settings(path: Path) -> tuple[Settings, Document]:
    """Read block.yaml.

    Raises
    ------
    InputError
        If the file is missing, no YAML, or breaks the contract; all faults at once.
    """
    document = load(path, InputError)
    if not isinstance(document.value, dict):
        raise InputError("is no mapping of keys to values", where=document.where(), remedy="begin with aatri_block: 1")
    try:
        settings = Settings.model_validate(document.value)
    except ValidationError as error:
        faults = [_fault(document, dict(item)) for item in error.errors(include_url=False)]
        raise_all(list({str(fault): fault for fault in faults}.values()))
        raise
    problems = []
    for section, names in (("frames", settings.frames), ("cameras", settings.cameras)):
        for name in names:
            if not is_valid(name):
                problems.append(InputError(f"{printable(name)!r} is no id", where=document.where_key(section, name)))
    raise_all(problems)
    return settings, document


def _fault(document: Document, item: dict[str, Any]) -> InputError:
    """One finding of the validation as an error with place, value and remedy."""
    keys = _keys(document.value, item["loc"])
    path = ".".join(str(key) for key in keys) or "block.yaml"
    if item["type"] == "extra_forbidden":
        known = _known_keys(keys[:-1])
        what = f"unknown key {printable(str(keys[-1]))!r} in {'.'.join(map(str, keys[:-1])) or 'block.yaml'}"
        remedy = f"keys are {', '.join(known)}; your own start with x_" if known else "remove it"
        return InputError(what + did_you_mean(str(keys[-1]), known), where=document.where_key(*keys), remedy=remedy)
    if item["type"] == "missing":
        return InputError(f"{path} is missing", where=document.where(*keys), remedy=f"add `{keys[-1]}:`")
    message, value = item["msg"].removeprefix("Value error, "), item["input"]
    if item["type"] == "value_error":
        return InputError(f"{path}: {message}", where=document.where(*keys), remedy="see docs/formats.md")
    if not message.startswith("Input should be "):
        return InputError(f"{path}: {message}", where=document.where(*keys), remedy="write as many values as it takes")
    message = message.removeprefix("Input should be ")
    shown = printable(repr(value)) if not isinstance(value, dict | list) else "a list or mapping"
    near = did_you_mean(value, message.replace("'", " ").split()) if isinstance(value, str) else ""
    return InputError(f"{path} is {shown}{near}", where=document.where(*keys), remedy=f"it must be {message}")


def _keys(value: Any, location: tuple[str | int, ...]) -> list[str | int]:
    """The keys of the file in a location of pydantic, which also names the members of unions."""
    keys: list[str | int] = []
    for n, step in enumerate(location):
        if step == "parameters" and not (isinstance(value, dict) and "parameters" in value):
            continue
        inside = (isinstance(value, dict) and step in value) or (isinstance(value, list) and isinstance(step, int))
        if inside and not (isinstance(value, list) and int(step) >= len(value)):
            keys.append(step)
            value = value[step]
        elif n == len(location) - 1 and isinstance(value, dict):
            keys.append(step)
    return keys


def _known_keys(keys: list[str | int]) -> list[str]:
    """The keys allowed in a section of the file."""
    names = [str(key) for key in keys]
    if not names:
        return list(Settings.model_fields)
    if names[0] == "frames":
        return list(FrameSettings.model_fields)
    if names[0] in ("units", "sigma"):
        return list((Units if names[0] == "units" else DefaultSigmas).model_fields)
    if names[0] == "cameras" and len(names) == 2:
        return list(CameraSettings.model_fields)
    if names[-1] == "pixel":
        return list(Pixel.model_fields)
    return ["model", "radius", "correction", *PARAMETERS["opencv"], "b1", "b2"] if names[-1] == "distortion" else []
