"""What can be set about a simulated block, in groups, with units and defaults; and the presets.

The groups are the nested options of `block/simulate`. A preset is a set of values laid under those the user gives.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, model_validator

from aatri.errors import AatriError, GeometryError
from aatri.options import Options

BROWN = ("k1", "k2", "k3", "p1", "p2", "b1", "b2")
"""Parameters of the Brown model, in the order used here."""

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Pair = tuple[float, float]
Triple = tuple[float, float, float]
Sigmas = tuple[NotNegative, NotNegative, NotNegative]


def _ascending(pair: Pair) -> Pair:
    if pair[0] > pair[1]:
        raise ValueError("the first number is to be the smaller one")
    return pair


def _share_or_count(much: float) -> float:
    if much >= 1 and much != int(much):
        raise ValueError("from 1 on it is a count, a whole number")
    return much


Much = Annotated[NotNegative, AfterValidator(_share_or_count)]
Range = Annotated[tuple[NotNegative, NotNegative], AfterValidator(_ascending)]


class CameraOptions(Options):
    """The camera, interior orientation and lens."""

    id: str = Field("camera", min_length=1, description="id of the camera")
    kind: Literal["film", "digital"] = Field("film", description="film (measured on a comparator) or digital (pixels)")
    principal_distance_mm: float = Field(153.84, gt=0, description="principal distance c, mm")
    principal_point_mm: Pair = Field((0.0, 0.0), description="from the fiducial or image centre, mm, x right, y up")
    symmetry_point_mm: Pair = Field((0.0, 0.0), description="centre of the distortion, from the principal point, mm")
    format: tuple[Positive, Positive] = Field(
        (230.0, 230.0), description="image format x, y: mm (film) or pixels (digital)"
    )
    pixel_size_mm: float = Field(0.0024, gt=0, description="pixel size of a digital camera, mm")
    fiducials: Literal[4, 8] = Field(4, description="fiducial marks of a film camera: 4 corners, or 4 sides as well")
    distortion: Literal["none", "brown", "table"] = Field("none", description="distortion model of the lens")
    brown: dict[Literal["k1", "k2", "k3", "p1", "p2", "b1", "b2"], float] = Field(
        {}, description="parameters of the brown model (mm and powers); those not named are 0"
    )
    distortion_known: bool = Field(True, description="the block knows the distortion; else it claims to have none")
    table_radius_mm: tuple[float, ...] = Field(
        (0.0, 40.0, 80.0, 120.0, 160.0), min_length=2, description="radii of the distortion table, ascending, mm"
    )
    table_correction_um: tuple[float, ...] = Field(
        (0.0, 2.0, 3.0, -1.0, -4.0), description="outward corrections at these radii, um; linear in between"
    )
    mounting_deg: Literal[0, 90, 180, 270] = Field(0, description="image x axis from the flight direction, degrees")
    margin_mm: float = Field(3.0, ge=0, description="border of the format in which nothing is measured, mm")

    @model_validator(mode="after")
    def _table_is_a_function(self) -> CameraOptions:
        if len(self.table_radius_mm) != len(self.table_correction_um):
            raise ValueError("table_radius_mm and table_correction_um differ in length")
        if any(b <= a for a, b in zip(self.table_radius_mm, self.table_radius_mm[1:])):
            raise ValueError("table_radius_mm does not ascend")
        return self

    @property
    def mm_per_unit(self) -> float:
        """Size on the image of one unit of the measured coordinates: 1 for film, the pixel size otherwise."""
        return 1.0 if self.kind == "film" else self.pixel_size_mm

    @property
    def half_format_mm(self) -> Pair:
        """Half the image format, mm."""
        return 0.5 * self.format[0] * self.mm_per_unit, 0.5 * self.format[1] * self.mm_per_unit

    def brown_parameters(self) -> tuple[float, ...]:
        """k1 k2 k3 p1 p2 b1 b2."""
        return tuple(self.brown.get(name, 0.0) for name in BROWN)  # type: ignore[call-overload]


class FlightOptions(Options):
    """Strips and stations."""

    arrangement: Literal["strips", "orbit", "hover"] = Field(
        "strips", description="parallel strips; rings about a place, looking at it; several images at each place"
    )
    strips: int = Field(3, ge=1, description="parallel strips, flown east and west in turn; rings; places")
    images_per_strip: int = Field(6, ge=2, description="images in each of them")
    five_heads_deg: float | None = Field(
        None,
        gt=0,
        lt=70,
        description="five cameras at each station of strips: down, and so far ahead, back, left, right",
    )
    orbit_elevations_deg: Range = Field(
        (25.0, 50.0), description="of the lowest and highest ring, seen from its middle"
    )
    orbit_share: float = Field(
        0.35, gt=0, le=1.5, description="half side of what is looked at, over half of what the shorter side could hold"
    )
    orbit_rolls: bool = Field(
        False,
        description="images of an orbit are turned about their view by 0, 90, 180, 270 degrees, one after another",
    )
    cross_strips: int = Field(0, ge=0, description="strips across, flown north and south in turn")
    images_per_cross_strip: int | None = Field(None, ge=2, description="images in each; empty: as many as span them")
    forward_overlap: float = Field(60.0, gt=0, lt=100, description="overlap along the strip, percent")
    side_overlap: float = Field(30.0, gt=0, lt=100, description="overlap of neighbouring strips, percent")
    scale_number: float = Field(2500.0, gt=0, description="scale number of the images: height above ground over c")
    position_sigma_m: Sigmas = Field((5.0, 5.0, 3.0), description="irregularity along, across and in height, m")
    tilt_sigma_deg: float = Field(0.7, ge=0, description="standard deviation of omega and phi, degrees")
    tilt_max_deg: float = Field(2.0, ge=0, lt=30, description="largest tilt; larger ones are clipped, degrees")
    kappa_sigma_deg: float = Field(1.0, ge=0, description="standard deviation of the heading, degrees")
    speed_m_per_s: float = Field(60.0, gt=0, description="ground speed, m/s; gives the exposure times")


class TerrainOptions(Options):
    """The ground."""

    mean_height_m: float = Field(6.0, description="mean height above sea level, m")
    relief_m: float = Field(15.0, ge=0, description="amplitude: heights stay within mean +- relief, m")
    wavelength_m: float = Field(1500.0, gt=0, description="shortest wavelength of the relief, m")


class TieOptions(Options):
    """New points: in clusters at the standard (Gruber) positions, and at random."""

    per_position: int = Field(2, ge=0, description="points at each standard position")
    spread_mm: float = Field(8.0, ge=0, description="half side of the square in which they lie, mm in the image")
    new_points: int | None = Field(None, ge=0, description="all new points, check points included; the rest is random")
    random_per_image: float = Field(0.0, ge=0, description="random points per image, where new_points is not given")


class ControlOptions(Options):
    """Control and check points; each count is of points of that kind."""

    full: int = Field(8, ge=0, description="control in X, Y and Z")
    plan: int = Field(0, ge=0, description="control in X and Y only")
    height: int = Field(0, ge=0, description="control in Z only")
    check_full: int = Field(0, ge=0, description="check points in X, Y and Z")
    check_plan: int = Field(0, ge=0, description="check points in X and Y only")
    check_height: int = Field(0, ge=0, description="check points in Z only")
    layout: tuple[str, ...] = Field(
        (),
        description="instead of all other points: the standard positions row by row from north, one letter each: "
        "X control in full, P plan only, Z height only, o new point, - none",
    )


class GnssOptions(Options):
    """Positions of the stations."""

    observed: bool = Field(True, description="positions are observed; otherwise none or approximate")
    approximate_positions: bool = Field(True, description="without observations, give those of the flight plan")
    shift_m: float = Field(0.0, ge=0, description="standard deviation of a shift common to each strip, m")
    drift_m_per_s: float = Field(0.0, ge=0, description="standard deviation of a drift in each strip, m/s")
    lever_arm_m: Triple = Field(
        (0.0, 0.0, 0.0), description="antenna minus projection centre, camera axes, m: positions are of the antenna"
    )


class ImuOptions(Options):
    """Attitudes of the stations."""

    observed: bool = Field(False, description="attitudes are observed")
    rotation: Literal["omega-phi-kappa", "phi-omega-kappa", "roll-pitch-heading"] = Field(
        "omega-phi-kappa", description="system of the angles"
    )
    heading: Literal["true", "grid"] = Field("true", description="north from which headings count")
    boresight_deg: Triple = Field(
        (0.0, 0.0, 0.0), description="true boresight: small turns about the camera axes, degrees"
    )
    boresight: Literal["known", "fixed", "weighted", "free"] = Field(
        "known", description="what the block says of it: the true value; 0, and its status"
    )
    boresight_sigma_deg: float = Field(1.0, gt=0, description="standard deviation of a weighted boresight, degrees")
    shift_deg: float = Field(0.0, ge=0, description="standard deviation of a shift common to each strip, degrees")
    drift_deg_per_s: float = Field(0.0, ge=0, description="standard deviation of a drift in each strip, degrees/s")


class RigMemberOptions(Options):
    """A camera beside the frame of the rig, of the same kind; its place and angles in the camera axes of the frame."""

    position_m: Triple = Field((0.0, 0.0, 0.0), description="projection centre, m")
    angles_deg: Triple = Field((0.0, 0.0, 0.0), description="omega, phi, kappa, degrees")
    error_m: Triple = Field((0.0, 0.0, 0.0), description="error of the place that the block gives")
    error_deg: Triple = Field((0.0, 0.0, 0.0), description="error of the angles the block gives")
    sigma_m: float = Field(0.0, ge=0, description="standard deviation of the place in the block, m; 0 fixed")
    sigma_deg: float = Field(0.0, ge=0, description="standard deviation of the angles in the block, degrees; 0 fixed")
    free: bool = Field(False, description="the block leaves place and angles free")


class FilmOptions(Options):
    """Film deformation (affine, per image) and the place of the film on the comparator."""

    deformation: bool = Field(True, description="the film is deformed; without, only turned and shifted")
    scale: Range = Field((1e-4, 3e-4), description="smallest and largest change of scale, in x and y on their own")
    shear: float = Field(1e-4, ge=0, description="largest shear, rad")
    rotation_deg: float = Field(0.5, ge=0, description="largest rotation on the comparator, degrees")
    shift_mm: float = Field(2.0, ge=0, description="largest shift on the comparator, mm")


class NoiseOptions(Options):
    """A-priori standard deviations. `factor` scales the errors put in, not these."""

    factor: float = Field(1.0, ge=0, description="size of the errors relative to the standard deviations; 0: none")
    image_um: float = Field(5.0, gt=0, description="image points, um")
    fiducial_um: float = Field(2.0, gt=0, description="fiducial marks, um")
    control_m: Sigmas = Field((0.02, 0.02, 0.03), description="control and check points in X, Y, Z, m; 0: exact")
    gnss_m: tuple[Positive, Positive, Positive] = Field((0.1, 0.1, 0.1), description="observed positions in X, Y, Z, m")
    attitude_deg: tuple[Positive, Positive, Positive] = Field(
        (0.005, 0.005, 0.01), description="observed attitudes, a1 a2 a3, degrees"
    )
    distance_m: float = Field(0.005, gt=0, description="distances, m")
    angle_deg: float = Field(0.0015, gt=0, description="directions, azimuths, angles, zenith angles, degrees")
    height_difference_m: float = Field(0.002, gt=0, description="height differences, m")
    baseline_m: float = Field(0.01, gt=0, description="coordinate differences, m; those of a baseline correlate by 0.3")
    relative_m: float = Field(0.005, gt=0, description="relative control, m")
    relative_deg: float = Field(0.02, gt=0, description="angles of relative control, degrees")


class EpochOptions(Options):
    """One of several epochs of one object: blocks with the same site have the same ground, stations and points."""

    site: str = Field("", description="name of the object; empty: a block of its own")
    moved: int = Field(0, ge=0, description="new points that have moved at this epoch")
    moved_m: Range = Field((0.05, 0.5), description="smallest and largest movement, any direction, m")


class GrossErrorOptions(Options):
    """Gross errors: of each kind a share of all if below 1, otherwise how many."""

    image_points: Much = Field(0.0, description="image points: share below 1, else count")
    fiducials: Much = Field(0.0, description="measured fiducial marks: share below 1, else count")
    control: Much = Field(0.0, description="control points: share below 1, else count")
    positions: Much = Field(0.0, description="observed positions: share below 1, else count")
    attitudes: Much = Field(0.0, description="observed attitudes: share below 1, else count")
    geodetic: Much = Field(0.0, description="geodetic observations: share below 1, else count")
    relative_control: Much = Field(0.0, description="members of relative control: share below 1, else count")
    size_sigmas: Range = Field((10.0, 50.0), description="smallest and largest size, in standard deviations")


def refused(what: str, remedy: str, error: type[AatriError] = GeometryError, option: str = "") -> AatriError:
    """The error of options that no block can have."""
    return error(what, where=f"options of block/simulate{option and ': '}{option}", remedy=remedy)


def over_preset(preset: Mapping[str, Any], options: Mapping[str, Any]) -> dict[str, Any]:
    """The preset's values with the given ones laid over them, group by group."""
    merged = dict(preset)
    for name, value in options.items():
        below = merged.get(name)
        above = value.model_dump(exclude_unset=True) if isinstance(value, Options) else _with_tuples(value)
        nested = isinstance(below, Mapping) and isinstance(above, Mapping) and name != "brown"
        merged[name] = over_preset(below, above) if nested else above  # type: ignore[arg-type]
    return merged


def _with_tuples(value: Any) -> Any:
    """Lists as tuples: strict validation takes lists for tuples only where they come straight from the file."""
    if isinstance(value, list):
        return tuple(map(_with_tuples, value))
    if isinstance(value, Mapping):
        return {key: _with_tuples(inner) for key, inner in value.items()}
    return value
