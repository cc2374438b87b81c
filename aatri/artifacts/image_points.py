"""ImagePoints: photo coordinates in mm, reduced to the principal point, with standard deviations.

Row k of `measurements` belongs to row k of the Block's `image_points`; what cannot be used is inactive, not missing.
`corrections` lists what has been applied, so that nothing is applied twice.
"""

from typing import ClassVar

from aatri.arrays import Bool, Float, Int, Text
from aatri.artifacts.suspects import Suspects
from aatri.tables.schema import Artifact, Table, column, table


class ImageIds(Table):
    """Images, as in the Block."""

    id: Text = column("str", doc="id of the image")


class PointIds(Table):
    """Points, as in the Block."""

    id: Text = column("str", doc="id of the point")


class Measurements(Table):
    """Photo coordinates, row by row as in the Block's image_points."""

    image: Int = column("i4", doc="row in images", refers="images")
    point: Int = column("i4", doc="row in points", refers="points")
    xy_mm: Float = column(
        "f8", 2, unit="mm", doc="photo coordinates from the principal point; NaN if not determined", optional=True
    )
    sigma_mm: Float = column("f8", 2, unit="mm", doc="standard deviation", uniform=True)
    active: Bool = column("bool", doc="to be used")


class Interior(Table):
    """Interior orientation of each image, from the measured system (u, v) to the photo system.

    photo = A (u, v) + t; bilinear: + e u v; projective: divided by 1 + e (u, v); [A | t] is `matrix`, e `terms`.
    `covariance` belongs to the numbers d0 ... d7 of the correction in the photo system that the fiducials leave open
    (geometry/plane_transformations.py): 4 of a similarity, 6 of an affine, 8 of a bilinear or projective
    transformation, zero for the rest and where the transformation is exactly known.
    """

    image: Int = column("i4", doc="row in images", refers="images")
    model: Text = column("str", doc="similarity, affine, bilinear, projective or calibrated")
    matrix: Float = column("f8", 2, 3, unit="1 and mm", doc="[A | t]: photo from measured")
    terms: Float = column("f8", 2, unit="mm or 1", doc="e: per squared unit (bilinear), per unit (projective), else 0")
    covariance: Float = column("f8", 8, 8, unit="mm and 1", doc="a priori covariance of d0 ... d7, see above")
    sigma0: Float = column(
        "f8", doc="a posteriori over a priori standard deviation; NaN without redundancy", optional=True
    )
    redundancy: Int = column("i4", doc="redundancy of the transformation")
    film_scale: Float = column("f8", 2, unit="1", doc="of the film along x and y; NaN without marks", optional=True)
    film_shear_rad: Float = column(
        "f8", unit="rad", doc="by which the y axis of the film leans; NaN without marks", optional=True
    )


class FiducialResiduals(Table):
    """Residuals of the fiducial marks."""

    row: Int = column("i4", doc="row in the Block's fiducial_points")
    image: Int = column("i4", doc="row in images", refers="images")
    fiducial: Text = column("str", doc="id of the mark")
    residual_mm: Float = column("f8", 2, unit="mm", doc="transformed minus calibrated")
    active: Bool = column("bool", doc="False if rejected")


class Corrections(Table):
    """Corrections already applied, in their order; none is applied twice."""

    name: Text = column("str", doc="film_deformation, principal_point, distortion, refraction or earth_curvature")
    largest_mm: Float = column("f8", unit="mm", doc="largest correction of any point")


class ImagePoints(Artifact):
    """Photo coordinates after interior orientation, and after image refinement."""

    schema_version: ClassVar[int] = 2

    images: ImageIds = table()
    points: PointIds = table()
    measurements: Measurements = table()
    interior: Interior = table()
    fiducial_residuals: FiducialResiduals = table()
    corrections: Corrections = table()
    suspects: Suspects = table()

    def metrics(self) -> dict[str, float | int | None]:
        """Counts, and the pooled sigma0 of the interior orientations."""
        pooled = int(self.interior.redundancy.sum())
        squares = (self.interior.sigma0**2 * self.interior.redundancy)[self.interior.redundancy > 0].sum()
        largest = {
            f"largest_{n}_um": 1e3 * float(v) for n, v in zip(self.corrections.name, self.corrections.largest_mm)
        }
        return {
            "images": len(self.interior),
            "image_points": int(self.measurements.active.sum()),
            "redundancy": pooled,
            "sigma0": float((squares / pooled) ** 0.5) if pooled else None,
            "suspects": len(self.suspects),
            **largest,
        }
