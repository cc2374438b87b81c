"""Tables of a Block: cameras and rigs, images, what was measured in them, and what is given of the ground.

The latter are coordinates, exterior, geodetic observations, relative control. Conventions are those of `block`.
"""

import numpy as np

from aatri.arrays import Bool, Float, Int, Text
from aatri.tables.schema import Table, column


class Cameras(Table):
    """Cameras: interior orientation as calibrated."""

    id: Text = column("str", doc="id of the camera")
    kind: Text = column("str", doc="film or digital", default="digital")
    image_coordinates: Text = column("str", doc="photo, comparator or pixel: what image_points.xy is", default="pixel")
    pixel_size_mm: Float = column("f8", 2, unit="mm", doc="pixel size in x and y", optional=True)
    pixel_origin: Text = column(
        "str", doc="top-left-corner, top-left-centre, bottom-left-corner or image-centre", default=""
    )
    pixel_y: Text = column("str", doc="down, up or empty", default="")
    format: Float = column("f8", 2, unit="mm (film) or px (digital)", doc="image format", optional=True)
    principal_distance_mm: Float = column("f8", unit="mm", doc="principal distance c")
    principal_point_mm: Float = column(
        "f8", 2, unit="mm", doc="from the fiducial or image centre, x right, y up", default=0.0
    )
    symmetry_point_mm: Float = column(
        "f8", 2, unit="mm", doc="centre of the distortion, from the principal point", default=0.0
    )
    distortion: Text = column(
        "str", doc="none, brown, table, opencv, polynomial, fisheye, bal or dbat3", default="none"
    )
    lever_arm_m: Float = column("f8", 3, unit="m", doc="antenna minus projection centre, camera axes", default=0.0)
    boresight_rad: Float = column(
        "f8", 3, unit="rad", doc="boresight misalignment: small turns about the camera axes", default=0.0
    )
    mount_deg: Int = column("i4", unit="deg", doc="image x clockwise from the nose: 0, 90, 180 or 270", default=0)


class CameraParameters(Table):
    """Distortion parameters, and standard deviations of any camera parameter."""

    camera: Int = column("i4", doc="row in cameras", refers="cameras")
    name: Text = column("str", doc="parameter, as in the block folder: k1, p2, principal_distance ...")
    value: Float = column("f8", doc="value in the convention of the distortion model", optional=True)
    sigma: Float = column("f8", doc="standard deviation; 0 fixed, NaN not given", optional=True, default=0.0)
    free: Bool = column("bool", doc="the parameter is to be estimated without weight", default=False)


class DistortionTable(Table):
    """Radial distortion as a table."""

    camera: Int = column("i4", doc="row in cameras", refers="cameras")
    radius_mm: Float = column("f8", unit="mm", doc="radius from the symmetry point")
    correction_mm: Float = column("f8", unit="mm", doc="added outwards to the measured coordinate")


class Fiducials(Table):
    """Calibrated fiducial marks."""

    camera: Int = column("i4", doc="row in cameras", refers="cameras")
    id: Text = column("str", doc="id of the mark")
    xy_mm: Float = column("f8", 2, unit="mm", doc="photo coordinates, origin at the fiducial centre")


class RigMembers(Table):
    """Cameras that are mounted together; the first member of a rig is its frame.

    position: projection centre of the member, in the camera axes of the frame; angles: omega, phi, kappa of the
    member's camera axes in those of the frame. Rows by rig, its frame first, then by member.
    """

    rig: Text = column("str", doc="id of the rig")
    member: Text = column("str", doc="id of the member, distinct within its rig")
    is_frame: Bool = column("bool", doc="the member is the frame of its rig")
    position_m: Float = column("f8", 3, unit="m", doc="projection centre in the camera axes of the frame")
    angles_rad: Float = column("f8", 3, unit="rad", doc="omega, phi, kappa from the frame")
    position_sigma_m: Float = column("f8", 3, unit="m", doc="standard deviations; 0 fixed", optional=True)
    position_free: Bool = column("bool", 3, doc="to be estimated without weight")
    angle_sigma_rad: Float = column("f8", 3, unit="rad", doc="standard deviations; 0 fixed", optional=True)
    angle_free: Bool = column("bool", 3, doc="to be estimated without weight")


class StripIds(Table):
    """Flight strips."""

    id: Text = column("str", doc="id of the strip")


class Images(Table):
    """Images of the block."""

    id: Text = column("str", doc="id of the image")
    camera: Int = column("i4", doc="row in cameras", refers="cameras")
    strip: Int = column("i4", doc="row in strips; -1 none", refers="strips", optional=True)
    sequence: Float = column("f8", doc="place in the strip: ascending along the flight", optional=True)
    time_s: Float = column("f8", unit="s", doc="time of exposure", optional=True)
    flight: Text = column("str", doc="flight, empty if not given", default="")
    session: Text = column("str", doc="session: images that share systematic errors, empty if not given", default="")
    rig: Text = column("str", doc="rig, empty if none", default="")
    member: Text = column("str", doc="member of the rig, empty if none", default="")
    path: Text = column("str", doc="file of the photograph, empty if not given", default="", digest=False)
    mask: Text = column("str", doc="file of its mask: 0 where no point is to be", default="", digest=False)
    content: Text = column("str", doc="SHA-256 of the files of photograph and mask, empty if not there", default="")
    active: Bool = column("bool", doc="False if rejected, see rejects", default=True)
    file: Int = column("i4", doc="row in files", refers="files", optional=True, digest=False)
    line: Int = column("i4", doc="line in the file, from 1", optional=True, digest=False)


class FiducialPoints(Table):
    """Measured fiducial marks."""

    image: Int = column("i4", doc="row in images", refers="images")
    fiducial: Int = column("i4", doc="row in fiducials", refers="fiducials")
    xy: Float = column("f8", 2, unit="mm (comparator) or px", doc="as measured")
    sigma_mm: Float = column("f8", 2, unit="mm", doc="standard deviation on the image")
    file: Int = column("i4", doc="row in files", refers="files", optional=True, digest=False)
    line: Int = column("i4", doc="line in the file, from 1", optional=True, digest=False)


class Points(Table):
    """All points, measured or given."""

    id: Text = column("str", doc="id of the point")


class MeasuredPoints(Table):
    """Measured image points."""

    image: Int = column("i4", doc="row in images", refers="images")
    point: Int = column("i4", doc="row in points", refers="points")
    xy: Float = column("f8", 2, unit="mm or px", doc="as measured, see cameras.image_coordinates")
    sigma_mm: Float = column("f8", 2, unit="mm", doc="standard deviation on the image", uniform=True)
    group: Text = column(
        "str", doc="group of observations with a common variance, empty if not given", default="", uniform=True
    )
    active: Bool = column("bool", doc="False if the file says so or if rejected, see rejects", default=True)
    row_time_s: Float = column(
        "f8", unit="s", doc="exposure time of the row, from the image's time", optional=True, uniform=True
    )
    file: Int = column("i4", doc="row in files", refers="files", optional=True, digest=False, uniform=True)
    line: Int = column("i4", doc="line in the file, from 1", optional=True, digest=False, uniform=True)


class GroundPoints(Table):
    """Given ground coordinates."""

    point: Int = column("i4", doc="row in points", refers="points")
    xyz_m: Float = column("f8", 3, unit="m", doc="coordinates; NaN unknown", optional=True)
    covariance_m2: Float = column("f8", 3, 3, unit="m^2", doc="covariance; a zero variance means fixed", default=0.0)
    role: Int = column("i4", 3, doc="per coordinate: 0 none, 1 control, 2 check, 3 approximate")
    datum: Bool = column("bool", doc="the datum of a free network rests on it", default=False)
    file: Int = column("i4", doc="row in files", refers="files", optional=True, digest=False)
    line: Int = column("i4", doc="line in the file, from 1", optional=True, digest=False)

    def given_as(self, *roles: int) -> Bool:
        """Which rows have a coordinate in one of the roles."""
        return np.asarray(np.isin(self.role, roles).any(axis=1))


class GroundPointCovariances(Table):
    """Covariances between given coordinates of two points; those of one point are in its own covariance."""

    row_a: Int = column("i4", doc="row in ground_points", refers="ground_points")
    axis_a: Int = column("i4", doc="0, 1 or 2: coordinate of the first point")
    row_b: Int = column("i4", doc="row in ground_points, after row_a", refers="ground_points")
    axis_b: Int = column("i4", doc="0, 1 or 2: coordinate of the second point")
    value: Float = column("f8", unit="m^2", doc="covariance")


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


class GeodeticCovariances(Table):
    """Covariances between geodetic observations."""

    row_a: Int = column("i4", doc="row in geodetic", refers="geodetic")
    row_b: Int = column("i4", doc="row in geodetic", refers="geodetic")
    value: Float = column("f8", unit="m^2, m rad or rad^2", doc="covariance")


class RelativeControl(Table):
    """Relative control: geometric conditions on points or stations."""

    type: Text = column("str", doc="distance, plane, plumb_line, angle ...")
    value: Float = column("f8", unit="m or rad", doc="value of the condition", optional=True)
    sigma: Float = column("f8", unit="m or rad", doc="standard deviation; 0 for an exact condition")
    axis: Text = column("str", doc="X, Y or Z of a coordinate difference, empty otherwise")
    file: Int = column("i4", doc="row in files", refers="files", optional=True, digest=False)
    line: Int = column("i4", doc="line in the file, from 1", optional=True, digest=False)


class RelativeControlMembers(Table):
    """Points or images of a relative control condition, in order."""

    condition: Int = column("i4", doc="row in relative_control", refers="relative_control")
    part: Text = column("str", doc="points, images, at, between or pairs")
    id: Text = column("str", doc="id of the point or image")


class ModelCoordinates(Table):
    """Points of stereo models measured without images, each model in axes and a unit of its own, Z upwards."""

    model: Text = column("str", doc="id of the model")
    point: Int = column("i4", doc="row in points", refers="points")
    xyz: Float = column("f8", 3, unit="model", doc="model coordinates")
    sigma: Float = column("f8", unit="model", doc="standard deviation of a coordinate")
    centre: Bool = column("bool", doc="a perspective centre of the model", default=False)
    file: Int = column("i4", doc="row in files", refers="files", optional=True, digest=False)
    line: Int = column("i4", doc="line in the file, from 1", optional=True, digest=False)
