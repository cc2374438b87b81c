"""Models: pairs of images oriented to each other.

The model frame is the frame of the left image: origin in its projection centre, axes those of its photo system; the
unit of length is the base. `left_from_right` turns a direction of the right image into the model frame.
"""

from aatri.arrays import Bool, Float, Int, Text
from aatri.artifacts.image_points import ImageIds, PointIds
from aatri.artifacts.suspects import Suspects, Uncontrolled
from aatri.tables.schema import Artifact, Table, column, table


class Orientations(Table):
    """Relative orientations, one row per model."""

    id: Text = column("str", doc="id of the model: left-right")
    left: Int = column("i4", doc="row in images", refers="images")
    right: Int = column("i4", doc="row in images", refers="images")
    left_from_right: Float = column("f8", 3, 3, doc="rotation matrix")
    base: Float = column("f8", 3, unit="base", doc="unit vector from left to right projection centre")
    covariance: Float = column(
        "f8", 5, 5, unit="rad^2", doc="of the increment d (R <- exp([d]x) R) and the base's turn along its two tangents"
    )
    sigma0: Float = column(
        "f8", doc="a posteriori over a priori standard deviation; NaN without redundancy", optional=True
    )
    redundancy: Int = column("i4", doc="redundancy")
    iterations: Int = column("i4", doc="iterations")


class ModelPoints(Table):
    """Points of the models."""

    model: Int = column("i4", doc="row in orientations", refers="orientations")
    point: Int = column("i4", doc="row in points", refers="points")
    xyz: Float = column("f8", 3, unit="base", doc="model coordinates")
    covariance: Float = column("f8", 3, 3, unit="base^2", doc="from the image coordinates, orientation held")
    parallax_mm: Float = column("f8", unit="mm", doc="y-parallax in the image: distance of the rays from coplanarity")
    active: Bool = column("bool", doc="False if rejected: then not used in the orientation")


class Elements(Table):
    """Elements of the orientations as the method has them: phi, omega, kappa of the Chinese system, base, scale.

    Those of the dependent method are in axes with X nearest to the base, quarters of a turn about z from the image's.
    """

    model: Int = column("i4", doc="row in orientations", refers="orientations")
    name: Text = column(
        "str", doc="phi2, omega2, kappa2, by/bx, bz/bx; phi1, kappa1, phi2 ...; scale (to the model before)"
    )
    value: Float = column("f8", unit="rad or 1", doc="angles in rad, by/bx, bz/bx and scale as ratios")
    sigma: Float = column("f8", unit="rad or 1", doc="standard deviation, a priori", optional=True)


class Unformed(Table):
    """Neighbouring images that make no model, with the reason."""

    left: Int = column("i4", doc="row in images", refers="images")
    right: Int = column("i4", doc="row in images", refers="images")
    common_points: Int = column("i4", doc="points measured in both")
    reason: Text = column("str", doc="why there is no model")


class SecondOrientations(Table):
    """Orientations that explain the points of a model as well as that in `orientations`: it is ambiguous."""

    model: Int = column("i4", doc="row in orientations", refers="orientations")
    left_from_right: Float = column("f8", 3, 3, doc="rotation matrix")
    base: Float = column("f8", 3, unit="base", doc="unit vector from left to right projection centre")


class Turns(Table):
    """Images taken from one place: they make no model, but their rotation is known."""

    left: Int = column("i4", doc="row in images", refers="images")
    right: Int = column("i4", doc="row in images", refers="images")
    left_from_right: Float = column("f8", 3, 3, doc="rotation matrix")
    sigma_rad: Float = column("f8", unit="rad", doc="standard deviation of its least certain direction")
    points: Int = column("i4", doc="points that it explains")


class Models(Artifact):
    """Relative orientations of neighbouring images, and their model points."""

    images: ImageIds = table()
    points: PointIds = table()
    orientations: Orientations = table()
    model_points: ModelPoints = table()
    unformed: Unformed = table()
    suspects: Suspects = table()
    elements: Elements | None = table(default=None, doc="elements of the method, where it tells them")
    second_orientations: SecondOrientations | None = table(default=None)
    turns: Turns | None = table(default=None)
    uncontrolled: Uncontrolled | None = table(
        default=None,
        doc="along the base, of points in one model; across it, where the y-parallax is not controlled; "
        "image points in no model",
    )

    def metrics(self) -> dict[str, float | int | None]:
        """Counts, pooled sigma0 and the RMS y-parallax."""
        pooled = int(self.orientations.redundancy.sum())
        weight = self.orientations.redundancy > 0
        squares = (self.orientations.sigma0**2 * self.orientations.redundancy)[weight].sum()
        parallax = self.model_points.parallax_mm[self.model_points.active]
        return {
            "models": len(self.orientations),
            "unformed": len(self.unformed),
            "model_points": int(self.model_points.active.sum()),
            "redundancy": pooled,
            "sigma0": float((squares / pooled) ** 0.5) if pooled else None,
            "parallax_rms_um": 1e3 * float((parallax**2).mean() ** 0.5) if len(parallax) else None,
            "suspects": len(self.suspects),
        }
