"""What can be set about the survey of a simulated block: geodetic observations and relative control."""

from typing import Literal

from pydantic import Field

from aatri.options import Options

Condition = Literal[
    "distance",
    "equal_distance",
    "coordinate_difference",
    "plane",
    "vertical_plane",
    "horizontal_plane",
    "equal_height",
    "line",
    "plumb_line",
    "horizontal_line",
    "angle",
    "parallel",
    "perpendicular",
    "sphere",
    "cylinder",
]


class SurveyOptions(Options):
    """Geodetic observations between near points, and relative control on points of its own."""

    distances: int = Field(0, ge=0, description="slope distances")
    horizontal_distances: int = Field(0, ge=0, description="horizontal distances")
    ellipsoid_distances: int = Field(0, ge=0, description="distances reduced to the ellipsoid (geodetic earth)")
    map_distances: int = Field(0, ge=0, description="distances reduced to the map")
    image_distances: int = Field(0, ge=0, description="slope distances from points to projection centres")
    direction_sets: int = Field(0, ge=0, description="sets of horizontal directions")
    directions_per_set: int = Field(5, ge=2, le=8, description="directions in each")
    azimuths: int = Field(0, ge=0, description="azimuths from grid north")
    angles: int = Field(0, ge=0, description="horizontal angles")
    zenith_angles: int = Field(0, ge=0, description="zenith angles")
    height_differences: int = Field(0, ge=0, description="height differences")
    baselines: int = Field(0, ge=0, description="coordinate differences dX, dY, dZ with their covariances")
    distance_scale: float = Field(0.0, gt=-0.1, lt=0.1, description="true scale of the slope distances, less 1")
    distance_addition_m: float = Field(0.0, description="true addition constant of the slope distances, m")
    refraction: float = Field(
        0.13, ge=-2, le=2, description="coefficient of refraction of zenith angles; a flat earth has none"
    )
    relative: dict[Condition, int] = Field({}, description="relative control: how many conditions of each type")
    points_per_shape: int = Field(7, ge=6, description="points of a plane, line, sphere or cylinder")
    shape_size_m: float = Field(20.0, gt=0, description="extent of what relative control joins, m")
    exact: bool = Field(False, description="relative control is exact, not observed")
