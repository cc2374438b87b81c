"""Tables of a Block: what is given of the ground: coordinates, exterior, geodetic observations, relative control.

Conventions are those of `block`.
"""

from dataclasses import dataclass

from aatri.arrays import Bool, Float, Int, Text
from aatri.tables.schema import Table, column


@dataclass(frozen=True, eq=False)
class GroundPoints(Table):
    """Given ground coordinates."""

    point: Int = column("i4", doc="row in points", refers="points")
    xyz_m: Float = column("f8", 3, unit="m", doc="coordinates; NaN unknown", optional=True)
    covariance_m2: Float = column("f8", 3, 3, unit="m^2", doc="covariance; a zero variance means fixed", default=0.0)
    role: Int = column("i4", 3, doc="per coordinate: 0 none, 1 control, 2 check, 3 approximate")
    datum: Bool = column("bool", doc="the datum of a free network rests on it", default=False)
    file: Int = column("i4", doc="row in files", refers="files", optional=True, digest=False)
    line: Int = column("i4", doc="line in the file, from 1", optional=True, digest=False)


@dataclass(frozen=True, eq=False)
class GroundPointCovariances(Table):
    """Covariances between given coordinates of two points; those of one point are in its own covariance."""

    row_a: Int = column("i4", doc="row in ground_points", refers="ground_points")
    axis_a: Int = column("i4", doc="0, 1 or 2: coordinate of the first point")
    row_b: Int = column("i4", doc="row in ground_points, after row_a", refers="ground_points")
    axis_b: Int = column("i4", doc="0, 1 or 2: coordinate of the second point")
    value: Float = column("f8", unit="m^2", doc="covariance")


@dataclass(frozen=True, eq=False)
class Exterior(Table):
    """Exterior orientation as given: GNSS positions, attitudes, approximate values."""

    image: Int = column("i4", doc="row in images", refers="images")
    position_m: Float = column("f8", 3, unit="m", doc="position; NaN not given", optional=True)
    position_covariance_m2: Float = column("f8", 3, 3, unit="m^2", doc="its covariance; NaN approximate", optional=True)
    angles_rad: Float = column(
        "f8", 3, unit="rad", doc="a1 a2 a3 in the system `rotation`; NaN not given", optional=True
    )
    angle_sigma_rad: Float = column("f8", 3, unit="rad", doc="standard deviations; NaN approximate", optional=True)
    position_use: Int = column("i4", doc="0 approximate, 1 observed", default=0)
    angle_use: Int = column("i4", doc="0 approximate, 1 observed", default=0)
    refers_to: Int = column("i4", doc="0 projection centre, 1 antenna", default=0)
    drift_group: Text = column("str", doc="shift-and-drift set, empty if none", default="")
    file: Int = column("i4", doc="row in files", refers="files", optional=True, digest=False)
    line: Int = column("i4", doc="line in the file, from 1", optional=True, digest=False)


@dataclass(frozen=True, eq=False)
class Geodetic(Table):
    """Geodetic observations between points or projection centres."""

    type: Text = column("str", doc="distance, horizontal_distance, direction, azimuth, angle, zenith, dX ...")
    start: Text = column("str", doc="id at which the observation starts")
    end: Text = column("str", doc="id at which it ends")
    via: Text = column("str", doc="vertex of an angle, empty otherwise", default="")
    start_kind: Text = column("str", doc="point or image", default="point")
    end_kind: Text = column("str", doc="point or image", default="point")
    value: Float = column("f8", unit="m or rad", doc="observed value")
    sigma: Float = column("f8", unit="m or rad", doc="standard deviation")
    set: Text = column("str", doc="direction set, empty otherwise", default="")
    group: Text = column("str", doc="shares scale and addition constant, empty if none", default="")
    start_height_m: Float = column("f8", unit="m", doc="instrument height", optional=True)
    end_height_m: Float = column("f8", unit="m", doc="target height", optional=True)
    active: Bool = column("bool", doc="False if switched off", default=True)
    reduced: Text = column("str", doc="no, horizon, ellipsoid or map", default="no")
    file: Int = column("i4", doc="row in files", refers="files", optional=True, digest=False)
    line: Int = column("i4", doc="line in the file, from 1", optional=True, digest=False)

    def called(self, k: int) -> str:
        """What messages and rejects call an observation."""
        return f"{self.type[k]} {self.start[k]} {self.end[k]}"


@dataclass(frozen=True, eq=False)
class GeodeticCovariances(Table):
    """Covariances between geodetic observations."""

    row_a: Int = column("i4", doc="row in geodetic", refers="geodetic")
    row_b: Int = column("i4", doc="row in geodetic", refers="geodetic")
    value: Float = column("f8", unit="m^2, m rad or rad^2", doc="covariance")


@dataclass(frozen=True, eq=False)
class RelativeControl(Table):
    """Relative control: geometric conditions on points or stations."""

    type: Text = column("str", doc="distance, plane, plumb_line, angle ...")
    value: Float = column("f8", unit="m or rad", doc="value of the condition", optional=True)
    sigma: Float = column("f8", unit="m or rad", doc="standard deviation; 0 for an exact condition")
    axis: Text = column("str", doc="X, Y or Z of a coordinate difference, empty otherwise")
    file: Int = column("i4", doc="row in files", refers="files", optional=True, digest=False)
    line: Int = column("i4", doc="line in the file, from 1", optional=True, digest=False)


@dataclass(frozen=True, eq=False)
class RelativeControlMembers(Table):
    """Points or images of a relative control condition, in order."""

    condition: Int = column("i4", doc="row in relative_control", refers="relative_control")
    part: Text = column("str", doc="points, images, at, between or pairs")
    id: Text = column("str", doc="id of the point or image")


@dataclass(frozen=True, eq=False)
class ModelCoordinates(Table):
    """Points of stereo models measured without images, each model in axes and a unit of its own, Z upwards."""

    model: Text = column("str", doc="id of the model")
    point: Int = column("i4", doc="row in points", refers="points")
    xyz: Float = column("f8", 3, unit="model", doc="model coordinates")
    sigma: Float = column("f8", unit="model", doc="standard deviation of a coordinate")
    centre: Bool = column("bool", doc="a perspective centre of the model", default=False)
    file: Int = column("i4", doc="row in files", refers="files", optional=True, digest=False)
    line: Int = column("i4", doc="line in the file, from 1", optional=True, digest=False)
