"""Block: the project as given.

Object space is right-handed (east, north, up; or the Cartesian axes of a tangent frame), metres. Whatever the axes of
the input tables are, the columns here are in this order. NaN is *not given*. Every imported row keeps its file and
line. Rows are in canonical order: ids by their bytes, measurements by image and point, so that the order of the input
never matters.

A Block comes with its tables: `block_tables` declares cameras, images, measurements and what is given of the ground.
All are imported from here.
"""

from typing import ClassVar, Protocol

import numpy as np

from aatri.arrays import Bool, Float, Int, Text
from aatri.artifacts.block_tables import (
    CameraParameters,
    Cameras,
    DistortionTable,
    Exterior,
    FiducialPoints,
    Fiducials,
    Geodetic,
    GeodeticCovariances,
    GroundPointCovariances,
    GroundPoints,
    Images,
    MeasuredPoints,
    ModelCoordinates,
    Points,
    RelativeControl,
    RelativeControlMembers,
    RigMembers,
    StripIds,
)
from aatri.artifacts.offers import NAMES, offers_of
from aatri.codes import (
    ANTENNA,
    APPROXIMATE,
    APPROXIMATE_VALUE,
    CHECK,
    CONTROL,
    NO_ROLE,
    OBSERVED_VALUE,
    PROJECTION_CENTRE,
)
from aatri.tables.offers import Offer
from aatri.tables.schema import Artifact, Table, attribute, column, table

__all__ = [
    "ANTENNA",
    "APPROXIMATE",
    "APPROXIMATE_VALUE",
    "BY_EDIT",
    "CHECK",
    "CONTROL",
    "NOT_SEEN",
    "NO_ROLE",
    "OBSERVED_VALUE",
    "PROJECTION_CENTRE",
    "TRUTH",
    "Block",
    "CameraParameters",
    "Cameras",
    "DistortionTable",
    "Exterior",
    "FiducialPoints",
    "Fiducials",
    "Files",
    "Frames",
    "Geodetic",
    "GeodeticCovariances",
    "GrossErrors",
    "GroundPointCovariances",
    "GroundPoints",
    "Images",
    "MeasuredPoints",
    "ModelCoordinates",
    "Points",
    "Rejects",
    "RelativeControl",
    "RelativeControlMembers",
    "RigMembers",
    "StripIds",
    "TrueImages",
    "TruePoints",
]

NOT_SEEN = "seen in no image"
"""Reason of a reject: a ground point that no image shows."""

BY_EDIT = "switched off by an edit"
"""How the reason of a reject begins that the user has made."""


class Files(Table):
    """Files the block was read from."""

    path: Text = column("str", doc="path as given", digest=False)


class Frames(Table):
    """Coordinate frames of the input; the first is the frame of all coordinates here."""

    id: Text = column("str", doc="name of the frame")
    axes: Text = column("str", doc="axes in the order of the tables, comma separated")
    crs: Text = column("str", doc="coordinate reference system as pyproj reads it, or local")
    vertical: Text = column("str", doc="vertical reference system, empty if none")


class Rejects(Table):
    """What was set aside on import, with the reason. Nothing is dropped without a row here."""

    kind: Text = column("str", doc="image, image_point, ground_point, fiducial or exterior")
    id: Text = column("str", doc="id of what was set aside; `image/point` for an image point")
    reason: Text = column("str", doc="why")
    file: Int = column("i4", doc="row in files", refers="files", optional=True, digest=False)
    line: Int = column("i4", doc="line in the file, from 1", optional=True, digest=False)


class TrueImages(Table):
    """True orientations of a simulated block."""

    image: Int = column("i4", doc="row in images", refers="images")
    position_m: Float = column("f8", 3, unit="m", doc="projection centre")
    ground_from_image: Float = column("f8", 3, 3, doc="rotation matrix R: X - X0 = lambda R (x, y, -c)")


class TruePoints(Table):
    """True coordinates of a simulated block."""

    point: Int = column("i4", doc="row in points", refers="points")
    xyz_m: Float = column("f8", 3, unit="m", doc="coordinates")


class GrossErrors(Table):
    """Gross errors a simulation has put in."""

    kind: Text = column("str", doc="image_point, fiducial, or the kind of observation")
    row: Int = column("i4", doc="row in its table")
    size: Float = column("f8", 3, doc="error added, in the unit of the table; zeros where it has fewer coordinates")


TRUTH = frozenset({"true_images", "true_points", "gross_errors"})
"""Tables only the accuracy stage may look at."""


class Imported(Protocol):
    """A table whose rows keep their file and line."""

    @property
    def file(self) -> Int:
        """Row in files of each; -1 if it was not imported."""

    @property
    def line(self) -> Int:
        """Line in the file, from 1."""


class Block(Artifact):
    """The project as given."""

    schema_version: ClassVar[int] = 3

    name: str = attribute(doc="name of the block")
    rotation: str = attribute(doc="system of exterior.angles_rad: omega-phi-kappa, phi-omega-kappa, roll-pitch-heading")
    earth_curvature: str = attribute(doc="correct (map frame), ignore (Cartesian frame) or frame (tangent frame)")
    terrain_height_m: float = attribute(unit="m", doc="mean height of the terrain; NaN not given")
    undulation_m: float = attribute(unit="m", doc="geoid undulation where no grid is at hand; NaN not given")
    heading: str = attribute(doc="what headings of attitudes count from: true (north) or grid")
    files: Files = table()
    frames: Frames = table()
    cameras: Cameras = table()
    camera_parameters: CameraParameters = table()
    distortion_table: DistortionTable = table()
    fiducials: Fiducials = table()
    rig_members: RigMembers = table()
    strips: StripIds = table()
    images: Images = table()
    fiducial_points: FiducialPoints = table()
    points: Points = table()
    image_points: MeasuredPoints = table()
    ground_points: GroundPoints = table()
    ground_point_covariances: GroundPointCovariances = table()
    exterior: Exterior = table()
    geodetic: Geodetic = table()
    geodetic_covariances: GeodeticCovariances = table()
    relative_control: RelativeControl = table()
    relative_control_members: RelativeControlMembers = table()
    rejects: Rejects = table()
    model_coordinates: ModelCoordinates | None = table(default=None)
    true_images: TrueImages | None = table(default=None)
    true_points: TruePoints | None = table(default=None)
    gross_errors: GrossErrors | None = table(default=None)

    @property
    def positions_m(self) -> Float:
        """Positions of exterior.csv, observed or approximate, image by image, (n_images, 3), m; NaN not given."""
        position_m = np.full((len(self.images), 3), np.nan)
        position_m[self.exterior.image] = self.exterior.position_m
        return position_m

    @property
    def given_m(self) -> Float:
        """Coordinates of ground_points.csv in any role, point by point, (n_points, 3), m; NaN not given."""
        xyz_m = np.full((len(self.points), 3), np.nan)
        xyz_m[self.ground_points.point] = self.ground_points.xyz_m
        return xyz_m

    def points_given_as(self, *roles: int) -> Bool:
        """Which points have a given coordinate in one of the roles, (n_points,)."""
        return np.isin(np.arange(len(self.points)), self.ground_points.point[self.ground_points.given_as(*roles)])

    def read_at(self, rows: Imported, row: int) -> str:
        """`file:line` of a row of a table, the file of one that has no lines; empty if it was not imported."""
        file, line = int(rows.file[row]), int(rows.line[row])
        return "" if file < 0 else f"{self.files.path[file]}:{line}" if line > 0 else str(self.files.path[file])

    def metrics(self) -> dict[str, float | int | None]:
        """Counts of what was given."""
        return {
            "images": int(self.images.active.sum()),
            "strips": len(self.strips),
            "cameras": len(self.cameras),
            "points": len(self.points),
            "image_points": int(self.image_points.active.sum()),
            "fiducial_points": len(self.fiducial_points),
            "control_points": int(self.ground_points.given_as(CONTROL).sum()),
            "check_points": int(self.ground_points.given_as(CHECK).sum()),
            "exterior_observations": int((self.exterior.position_use + self.exterior.angle_use > 0).sum()),
            "rejects": len(self.rejects),
        }

    def offers(self) -> tuple[Offer, ...]:
        """What was given and is to have an effect."""
        return offers_of(self)

    @classmethod
    def offered_names(cls) -> frozenset[str]:
        """All names under which a Block may offer something."""
        return NAMES
