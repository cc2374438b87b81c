"""Block: the project as given.

Object space is right-handed (east, north, up; or the Cartesian axes of a tangent frame), metres. Whatever the axes of
the input tables are, the columns here are in this order. NaN is *not given*. Every imported row keeps its file and
line. Rows are in canonical order: ids by their bytes, measurements by image and point, so that the order of the input
never matters.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from aatri.arrays import Bool, Float, Int, Text
from aatri.codes import (
    ANTENNA as ANTENNA,
    APPROXIMATE as APPROXIMATE,
    APPROXIMATE_VALUE as APPROXIMATE_VALUE,
    CHECK as CHECK,
    CONTROL as CONTROL,
    NO_ROLE as NO_ROLE,
    OBSERVED_VALUE as OBSERVED_VALUE,
    PROJECTION_CENTRE as PROJECTION_CENTRE,
)
from aatri.tables.schema import Artifact, Table, attribute, column, table


@dataclass(frozen=True, eq=False)
class Files(Table):
    """Files the block was read from."""

    path: Text = column("str", doc="path as given", digest=False)


@dataclass(frozen=True, eq=False)
class Frames(Table):
    """Coordinate frames of the input; the first is the frame of all coordinates here."""

    id: Text = column("str", doc="name of the frame")
    axes: Text = column("str", doc="axes in the order of the tables, comma separated")
    crs: Text = column("str", doc="coordinate reference system as pyproj reads it, or local")
    vertical: Text = column("str", doc="vertical reference system, empty if none")


@dataclass(frozen=True, eq=False)
class Cameras(Table):
    """Cameras: interior orientation as calibrated."""

    id: Text = column("str", doc="id of the camera")
    kind: Text = column("str", doc="film or digital")
    image_coordinates: Text = column("str", doc="photo, comparator or pixel: what image_points.xy is")
    pixel_size_mm: Float = column("f8", 2, unit="mm", doc="pixel size in x and y", optional=True)
    pixel_origin: Text = column("str", doc="top-left-corner, top-left-centre, bottom-left-corner or image-centre")
    pixel_y: Text = column("str", doc="down, up or empty")
    format: Float = column("f8", 2, unit="mm (film) or px (digital)", doc="image format", optional=True)
    principal_distance_mm: Float = column("f8", unit="mm", doc="principal distance c")
    principal_point_mm: Float = column("f8", 2, unit="mm", doc="from the fiducial or image centre, x right, y up")
    symmetry_point_mm: Float = column("f8", 2, unit="mm", doc="centre of the distortion, from the principal point")
    distortion: Text = column("str", doc="none, brown, table, opencv, fisheye or bal")
    lever_arm_m: Float = column("f8", 3, unit="m", doc="antenna minus projection centre, camera axes")
    boresight_rad: Float = column("f8", 3, unit="rad", doc="boresight misalignment")


@dataclass(frozen=True, eq=False)
class CameraParameters(Table):
    """Distortion parameters, and standard deviations of any camera parameter."""

    camera: Int = column("i4", doc="row in cameras", refers="cameras")
    name: Text = column("str", doc="parameter, as in the block folder: k1, p2, principal_distance ...")
    value: Float = column("f8", doc="value in the convention of the distortion model", optional=True)
    sigma: Float = column("f8", doc="standard deviation; 0 fixed, NaN not given", optional=True)
    free: Bool = column("bool", doc="the parameter is to be estimated without weight")


@dataclass(frozen=True, eq=False)
class DistortionTable(Table):
    """Radial distortion as a table."""

    camera: Int = column("i4", doc="row in cameras", refers="cameras")
    radius_mm: Float = column("f8", unit="mm", doc="radius from the symmetry point")
    correction_mm: Float = column("f8", unit="mm", doc="added outwards to the measured coordinate")


@dataclass(frozen=True, eq=False)
class Fiducials(Table):
    """Calibrated fiducial marks."""

    camera: Int = column("i4", doc="row in cameras", refers="cameras")
    id: Text = column("str", doc="id of the mark")
    xy_mm: Float = column("f8", 2, unit="mm", doc="photo coordinates, origin at the fiducial centre")


@dataclass(frozen=True, eq=False)
class FiducialPoints(Table):
    """Measured fiducial marks."""

    image: Int = column("i4", doc="row in images", refers="images")
    fiducial: Int = column("i4", doc="row in fiducials", refers="fiducials")
    xy: Float = column("f8", 2, unit="mm (comparator) or px", doc="as measured")
    sigma_mm: Float = column("f8", 2, unit="mm", doc="standard deviation on the image")
    file: Int = column("i4", doc="row in files", refers="files", optional=True, digest=False)
    line: Int = column("i4", doc="line in the file, from 1", optional=True, digest=False)


@dataclass(frozen=True, eq=False)
class Strips(Table):
    """Flight strips."""

    id: Text = column("str", doc="id of the strip")


@dataclass(frozen=True, eq=False)
class Images(Table):
    """Images of the block."""

    id: Text = column("str", doc="id of the image")
    camera: Int = column("i4", doc="row in cameras", refers="cameras")
    strip: Int = column("i4", doc="row in strips; -1 none", refers="strips", optional=True)
    sequence: Float = column("f8", doc="place in the strip: ascending along the flight", optional=True)
    time_s: Float = column("f8", unit="s", doc="time of exposure", optional=True)
    flight: Text = column("str", doc="flight, empty if not given")
    session: Text = column("str", doc="session: images that share systematic errors, empty if not given")
    rig: Text = column("str", doc="rig, empty if none")
    member: Text = column("str", doc="member of the rig, empty if none")
    active: Bool = column("bool", doc="False if rejected, see rejects")
    file: Int = column("i4", doc="row in files", refers="files", optional=True, digest=False)
    line: Int = column("i4", doc="line in the file, from 1", optional=True, digest=False)


@dataclass(frozen=True, eq=False)
class Points(Table):
    """All points, measured or given."""

    id: Text = column("str", doc="id of the point")


@dataclass(frozen=True, eq=False)
class ImagePoints(Table):
    """Measured image points."""

    image: Int = column("i4", doc="row in images", refers="images")
    point: Int = column("i4", doc="row in points", refers="points")
    xy: Float = column("f8", 2, unit="mm or px", doc="as measured, see cameras.image_coordinates")
    sigma_mm: Float = column("f8", 2, unit="mm", doc="standard deviation on the image")
    group: Text = column("str", doc="group of observations with a common variance, empty if not given")
    active: Bool = column("bool", doc="False if the file says so or if rejected, see rejects")
    row_time_s: Float = column("f8", unit="s", doc="exposure time of the row, from the image's time", optional=True)
    file: Int = column("i4", doc="row in files", refers="files", optional=True, digest=False)
    line: Int = column("i4", doc="line in the file, from 1", optional=True, digest=False)


@dataclass(frozen=True, eq=False)
class GroundPoints(Table):
    """Given ground coordinates."""

    point: Int = column("i4", doc="row in points", refers="points")
    xyz_m: Float = column("f8", 3, unit="m", doc="coordinates; NaN unknown", optional=True)
    covariance_m2: Float = column("f8", 3, 3, unit="m^2", doc="covariance; a zero variance means fixed")
    role: Int = column("i4", 3, doc="per coordinate: 0 none, 1 control, 2 check, 3 approximate")
    datum: Bool = column("bool", doc="the datum of a free network rests on it")
    file: Int = column("i4", doc="row in files", refers="files", optional=True, digest=False)
    line: Int = column("i4", doc="line in the file, from 1", optional=True, digest=False)


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
    position_use: Int = column("i4", doc="0 approximate, 1 observed")
    angle_use: Int = column("i4", doc="0 approximate, 1 observed")
    refers_to: Int = column("i4", doc="0 projection centre, 1 antenna")
    drift_group: Text = column("str", doc="shift-and-drift set, empty if none")
    file: Int = column("i4", doc="row in files", refers="files", optional=True, digest=False)
    line: Int = column("i4", doc="line in the file, from 1", optional=True, digest=False)


@dataclass(frozen=True, eq=False)
class Geodetic(Table):
    """Geodetic observations between points or projection centres."""

    type: Text = column("str", doc="distance, horizontal_distance, direction, azimuth, angle, zenith, dX ...")
    start: Text = column("str", doc="id at which the observation starts")
    end: Text = column("str", doc="id at which it ends")
    via: Text = column("str", doc="vertex of an angle, empty otherwise")
    start_kind: Text = column("str", doc="point or image")
    end_kind: Text = column("str", doc="point or image")
    value: Float = column("f8", unit="m or rad", doc="observed value")
    sigma: Float = column("f8", unit="m or rad", doc="standard deviation")
    set: Text = column("str", doc="direction set, empty otherwise")
    group: Text = column("str", doc="shares scale and addition constant, empty if none")
    start_height_m: Float = column("f8", unit="m", doc="instrument height", optional=True)
    end_height_m: Float = column("f8", unit="m", doc="target height", optional=True)
    active: Bool = column("bool", doc="False if switched off")
    reduced: Text = column("str", doc="no, horizon, ellipsoid or map")
    file: Int = column("i4", doc="row in files", refers="files", optional=True, digest=False)
    line: Int = column("i4", doc="line in the file, from 1", optional=True, digest=False)


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
class Rejects(Table):
    """What was set aside on import, with the reason. Nothing is dropped without a row here."""

    kind: Text = column("str", doc="image, image_point, ground_point, fiducial or exterior")
    id: Text = column("str", doc="id of what was set aside; `image/point` for an image point")
    reason: Text = column("str", doc="why")
    file: Int = column("i4", doc="row in files", refers="files", optional=True, digest=False)
    line: Int = column("i4", doc="line in the file, from 1", optional=True, digest=False)


@dataclass(frozen=True, eq=False)
class TrueImages(Table):
    """True orientations of a simulated block."""

    image: Int = column("i4", doc="row in images", refers="images")
    position_m: Float = column("f8", 3, unit="m", doc="projection centre")
    ground_from_image: Float = column("f8", 3, 3, doc="rotation matrix R: X - X0 = lambda R (x, y, -c)")


@dataclass(frozen=True, eq=False)
class TruePoints(Table):
    """True coordinates of a simulated block."""

    point: Int = column("i4", doc="row in points", refers="points")
    xyz_m: Float = column("f8", 3, unit="m", doc="coordinates")


@dataclass(frozen=True, eq=False)
class GrossErrors(Table):
    """Gross errors a simulation has put in."""

    kind: Text = column("str", doc="image_point, fiducial, control or position")
    row: Int = column("i4", doc="row in its table")
    size: Float = column("f8", 3, doc="error added, in the unit of the table; zeros where it has fewer coordinates")


TRUTH = frozenset({"true_images", "true_points", "gross_errors"})
"""Tables only the accuracy stage may look at."""


@dataclass(frozen=True, eq=False)
class Block(Artifact):
    """The project as given."""

    kind: ClassVar[str] = "Block"
    schema_version: ClassVar[int] = 1

    name: str = attribute(doc="name of the block")
    rotation: str = attribute(doc="system of exterior.angles_rad: omega-phi-kappa, phi-omega-kappa, roll-pitch-heading")
    earth_curvature: str = attribute(doc="correct (map frame), ignore (Cartesian frame) or frame (tangent frame)")
    terrain_height_m: float = attribute(unit="m", doc="mean height of the terrain; NaN not given")
    files: Files = table()
    frames: Frames = table()
    cameras: Cameras = table()
    camera_parameters: CameraParameters = table()
    distortion_table: DistortionTable = table()
    fiducials: Fiducials = table()
    strips: Strips = table()
    images: Images = table()
    fiducial_points: FiducialPoints = table()
    points: Points = table()
    image_points: ImagePoints = table()
    ground_points: GroundPoints = table()
    exterior: Exterior = table()
    geodetic: Geodetic = table()
    geodetic_covariances: GeodeticCovariances = table()
    relative_control: RelativeControl = table()
    relative_control_members: RelativeControlMembers = table()
    rejects: Rejects = table()
    true_images: TrueImages | None = table(default=None)
    true_points: TruePoints | None = table(default=None)
    gross_errors: GrossErrors | None = table(default=None)

    def metrics(self) -> dict[str, float | int | None]:
        """Counts of what was given."""
        role = self.ground_points.role
        return {
            "images": int(self.images.active.sum()),
            "strips": len(self.strips),
            "cameras": len(self.cameras),
            "points": len(self.points),
            "image_points": int(self.image_points.active.sum()),
            "fiducial_points": len(self.fiducial_points),
            "control_points": int((role == CONTROL).any(axis=1).sum()),
            "check_points": int((role == CHECK).any(axis=1).sum()),
            "exterior_observations": int((self.exterior.position_use + self.exterior.angle_use > 0).sum()),
            "rejects": len(self.rejects),
        }
