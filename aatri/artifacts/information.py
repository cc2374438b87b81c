"""Information: what a block says of the unknowns that it shares with others, all of its own eliminated.

    v'Pv (x) = cost + 2 right' d + d' N d,    d = x - value        (for rotations R <- exp([d]x) R)

The reduced normal equations N d + right = 0 of the kept unknowns stand for all observations of the block: added to the
normal equations of another, they give the adjustment of both. Coordinates are those of the adjustment, reduced to its
origin; in a tangent frame that has an origin of its own. Which observations stand in it is listed as far as another
block could have them too, and everything that was eliminated.
"""

import numpy as np

from aatri.arrays import Float, Int, Text
from aatri.artifacts.solution import CalibratedSets
from aatri.tables.schema import Artifact, Table, attribute, column, table


class KeptUnknowns(Table):
    """Unknowns of the reduced normal equations, in their order."""

    group: Text = column("str", doc="image, point, additional, camera, film, drift ...")
    object: Text = column("str", doc="id of the image, point, camera ...")
    name: Text = column("str", doc="name of the unknown")
    value: Float = column("f8", doc="where the equations are linearised; NaN: a rotation", optional=True)
    right: Float = column("f8", doc="right side: half the gradient of v'Pv there")


class KeptImages(Table):
    """Orientations of kept images where the equations are linearised."""

    image: Text = column("str", doc="id of the image")
    position_m: Float = column("f8", 3, unit="m", doc="projection centre, reduced")
    ground_from_image: Float = column("f8", 3, 3, doc="rotation matrix R")


class Normals(Table):
    """The reduced normal matrix: its lower triangle row by row."""

    value: Float = column("f8", doc="N11, N21, N22, N31 ...")


class EliminatedObjects(Table):
    """Images and points that were eliminated: no other block may have them."""

    group: Text = column("str", doc="image or point")
    object: Text = column("str", doc="id")


class CountedObservations(Table):
    """Observations of kept images and points alone, which another block could have too."""

    kind: Text = column("str", doc="kind of observation")
    image: Text = column("str", doc="id of the image, empty if none")
    point: Text = column("str", doc="id of the point, empty if none")
    digest: Int = column("i8", doc="of the observed values; 0 if it has none")


class CameraDigests(Table):
    """Cameras of the block."""

    id: Text = column("str", doc="id of the camera")
    digest: Text = column("str", doc="of all its figures")


class Information(Artifact):
    """Reduced normal equations of a block."""

    block: str = attribute(doc="name of the block")
    frame: str = attribute(doc="first frame of the block: axes, crs, vertical, undulation, earth curvature")
    cost: float = attribute(doc="v'Pv at the values, what was eliminated at its best")
    observations: int = attribute(doc="observations in it")
    eliminated: int = attribute(doc="unknowns that were eliminated")
    tangent_x_m: float = attribute(unit="m", doc="origin of the tangent frame in the frame of the block; NaN none")
    tangent_y_m: float = attribute(unit="m", doc="the same")
    tangent_z_m: float = attribute(unit="m", doc="the same")
    origin_x_m: float = attribute(unit="m", doc="what coordinates are reduced by")
    origin_y_m: float = attribute(unit="m", doc="the same")
    origin_z_m: float = attribute(unit="m", doc="the same")
    unknowns: KeptUnknowns = table()
    images: KeptImages = table()
    normals: Normals = table()
    eliminated_objects: EliminatedObjects = table()
    counted: CountedObservations = table()
    cameras: CameraDigests = table()
    calibrated_sets: CalibratedSets | None = table(default=None)

    @property
    def origin_m(self) -> Float:
        """What coordinates are reduced by, (3,) m."""
        return np.array([self.origin_x_m, self.origin_y_m, self.origin_z_m])

    @property
    def tangent_m(self) -> Float | None:
        """Origin of the tangent frame, (3,) m; None where the frame is that of the block."""
        place = np.array([self.tangent_x_m, self.tangent_y_m, self.tangent_z_m])
        return place if np.isfinite(place).all() else None

    @property
    def matrix(self) -> Float:
        """The reduced normal matrix, (n, n)."""
        n = len(self.unknowns)
        N = np.zeros((n, n))
        N[np.tril_indices(n)] = self.normals.value
        return N + np.tril(N, -1).T

    def metrics(self) -> dict[str, float | int | None]:
        """What stands in it."""
        return {
            "unknowns": len(self.unknowns),
            "images": len(self.images),
            "points": len(np.unique(self.unknowns.object[self.unknowns.group == "point"])),
            "observations": self.observations,
            "eliminated": self.eliminated,
        }
