"""Features, Matches, ScanMarks: what is found in the pixels of one image, and what agrees between two."""

from aatri.arrays import Float, Int
from aatri.tables.schema import Artifact, Table, attribute, column, table


class Keypoints(Table):
    """Places of an image that look the same in others."""

    xy_px: Float = column("f8", 2, unit="px", doc="from the centre of the first pixel, x right, y down")
    size_px: Float = column("f8", unit="px", doc="diameter of what was looked at")
    angle_rad: Float = column("f8", unit="rad", doc="orientation, clockwise from x")
    response: Float = column("f8", doc="contrast")
    descriptor: Int = column("i1", 128, doc="histograms of gradients, minus 128")


class Features(Artifact):
    """Features of one image."""

    keypoints: Keypoints = table()


class MatchedKeypoints(Table):
    """Features of two images that agree."""

    left: Int = column("i4", doc="row in the keypoints of the left image")
    right: Int = column("i4", doc="row in the keypoints of the right image")


class Matches(Artifact):
    """Matches of one pair of images."""

    pairs: MatchedKeypoints = table()


class FoundMarks(Table):
    """The best places of marks, in the order in which they were asked for."""

    xy_px: Float = column("f8", 2, unit="px", doc="from the centre of the first pixel; NaN: none", optional=True)
    sigma_px: Float = column("f8", 2, unit="px", doc="standard deviation", optional=True)
    correlation: Float = column("f8", doc="with the template; negative: of a negative")
    second: Float = column("f8", doc="correlation at the next best place, as a share of that of the best")


class ScanMarks(Artifact):
    """Places of fiducial marks in one scan."""

    width_px: int = attribute(unit="px", doc="of the scan")
    height_px: int = attribute(unit="px", doc="of the scan")
    marks: FoundMarks = table()
