"""Tables of a Block: cameras and rigs, images, and what was measured in them.

Conventions are those of `block`.
"""

from dataclasses import dataclass

from aatri.arrays import Bool, Float, Int, Text
from aatri.tables.schema import Table, column


@dataclass(frozen=True, eq=False)
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


@dataclass(frozen=True, eq=False)
class CameraParameters(Table):
    """Distortion parameters, and standard deviations of any camera parameter."""

    camera: Int = column("i4", doc="row in cameras", refers="cameras")
    name: Text = column("str", doc="parameter, as in the block folder: k1, p2, principal_distance ...")
    value: Float = column("f8", doc="value in the convention of the distortion model", optional=True)
    sigma: Float = column("f8", doc="standard deviation; 0 fixed, NaN not given", optional=True, default=0.0)
    free: Bool = column("bool", doc="the parameter is to be estimated without weight", default=False)


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


@dataclass(frozen=True, eq=False)
class StripIds(Table):
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
class Points(Table):
    """All points, measured or given."""

    id: Text = column("str", doc="id of the point")


@dataclass(frozen=True, eq=False)
class MeasuredPoints(Table):
    """Measured image points."""

    image: Int = column("i4", doc="row in images", refers="images")
    point: Int = column("i4", doc="row in points", refers="points")
    xy: Float = column("f8", 2, unit="mm or px", doc="as measured, see cameras.image_coordinates")
    sigma_mm: Float = column("f8", 2, unit="mm", doc="standard deviation on the image", uniform=True)
    group: Text = column("str", doc="group of observations with a common variance, empty if not given", default="",
                         uniform=True)  # fmt: skip
    active: Bool = column("bool", doc="False if the file says so or if rejected, see rejects", default=True)
    row_time_s: Float = column("f8", unit="s", doc="exposure time of the row, from the image's time", optional=True,
                               uniform=True)  # fmt: skip
    file: Int = column("i4", doc="row in files", refers="files", optional=True, digest=False, uniform=True)
    line: Int = column("i4", doc="line in the file, from 1", optional=True, digest=False, uniform=True)
