"""Strips: models joined to strips, each in a frame of its own.

The strip frame is that of the strip's first image; the unit of length is the base of its first model. A strip of the
Block that is broken by a missing model gives several strips here, and a row in `gaps`.
"""

from aatri.arrays import Bool, Float, Int, Text
from aatri.artifacts.image_points import ImageIds, PointIds
from aatri.artifacts.suspects import Suspects, Uncontrolled
from aatri.tables.schema import Artifact, Table, column, table


class FreeStrips(Table):
    """Free strips."""

    id: Text = column("str", doc="id: the Block's strip, with .1 .2 ... where it is broken")


class StripImages(Table):
    """Images in their strips, in order along the strip."""

    strip: Int = column("i4", doc="row in strips", refers="strips")
    image: Int = column("i4", doc="row in images", refers="images")
    position: Float = column("f8", 3, unit="first base", doc="projection centre in the strip frame")
    strip_from_image: Float = column("f8", 3, 3, doc="rotation matrix")


class StripPoints(Table):
    """Points in their strips: weighted mean over the models."""

    strip: Int = column("i4", doc="row in strips", refers="strips")
    point: Int = column("i4", doc="row in points", refers="points")
    xyz: Float = column("f8", 3, unit="first base", doc="coordinates in the strip frame")
    covariance: Float = column("f8", 3, 3, unit="first base^2", doc="from the image coordinates, orientations held")
    models: Int = column("i4", doc="number of models that hold the point")


class Joints(Table):
    """Where two neighbouring models are joined: they share an image."""

    strip: Int = column("i4", doc="row in strips", refers="strips")
    image: Int = column("i4", doc="row in images: the common image", refers="images")
    scale: Float = column("f8", doc="scale factor of the second model to the first")
    sigma: Float = column("f8", doc="its standard deviation", optional=True)
    points: Int = column("i4", doc="connection points used")


class Discrepancies(Table):
    """Discrepancies of the connection points after joining."""

    joint: Int = column("i4", doc="row in joints", refers="joints")
    point: Int = column("i4", doc="row in points", refers="points")
    xyz: Float = column("f8", 3, unit="first base", doc="second minus first model, strip frame")
    log_scale: Float = column("f8", doc="logarithm of the point's own scale factor minus the joint's")
    active: Bool = column("bool", doc="False if rejected")


class Gaps(Table):
    """Where a strip of the Block is broken, and images left without a strip."""

    strip: Text = column("str", doc="id of the Block's strip, empty if none")
    left: Text = column("str", doc="id of the last image before the gap, empty at the start")
    right: Text = column("str", doc="id of the first image after the gap, empty at the end")
    reason: Text = column("str", doc="why")


class StripScales(Table):
    """Scale of each strip by its control: extent on the ground over extent in the strip."""

    strip: Int = column("i4", doc="row in strips", refers="strips")
    control_points: Int = column("i4", doc="of three known coordinates; two are needed")
    metres: Float = column("f8", unit="m", doc="length of the first base on the ground", optional=True)
    scale_number: Float = column("f8", doc="of its images: median", optional=True)


class ImageScales(Table):
    """Scale numbers of the images of the strips that have a scale."""

    strip: Int = column("i4", doc="row in strips", refers="strips")
    image: Int = column("i4", doc="row in images", refers="images")
    scale_number: Float = column("f8", doc="median distance of its points along its axis, over c", optional=True)


class PlacedPoints(Table):
    """Points of every model in its strip, those of several models in each of them: none are averaged."""

    strip: Int = column("i4", doc="row in strips", refers="strips")
    model: Text = column("str", doc="id of the model: left-right")
    point: Int = column("i4", doc="row in points", refers="points")
    xyz: Float = column("f8", 3, unit="first base", doc="coordinates in the strip frame")
    xyz_m: Float = column("f8", 3, unit="m", doc="the same by the scale of the strip; NaN without one", optional=True)


class Strips(Artifact):
    """Free strips."""

    images: ImageIds = table()
    points: PointIds = table()
    strips: FreeStrips = table()
    strip_images: StripImages = table()
    strip_points: StripPoints = table()
    joints: Joints = table()
    discrepancies: Discrepancies = table()
    gaps: Gaps = table()
    suspects: Suspects = table()
    scales: StripScales | None = table(default=None)
    image_scales: ImageScales | None = table(default=None)
    placed_points: PlacedPoints | None = table(default=None)
    uncontrolled: Uncontrolled | None = table(
        default=None,
        doc="along the base, of points in one model of their strip; image points in no model; connection "
        "points that nothing checks",
    )

    def metrics(self) -> dict[str, float | int | None]:
        """Counts, and the RMS of the scale discrepancies."""
        used = self.discrepancies.log_scale[self.discrepancies.active]
        return {
            "strips": len(self.strips),
            "images": len(self.strip_images),
            "points": len(self.strip_points),
            "joints": len(self.joints),
            "scale_discrepancy_rms_ppm": 1e6 * float((used**2).mean() ** 0.5) if len(used) else None,
            "gaps": len(self.gaps),
            "suspects": len(self.suspects),
        }
