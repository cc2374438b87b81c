"""What images have in common: camera, strip, flight; errors and standard deviations may be common to them."""

from dataclasses import dataclass

from aatri.arrays import Float, Int, Text


@dataclass(frozen=True)
class ImageGroups:
    """Camera, strip, flight and time of all images."""

    cameras: Text
    """(k,) str. Ids of all cameras."""
    corner_mm: Float
    """(k,), mm. Half the diagonal of their formats; NaN unknown."""
    camera: Int
    """(n,). Of each image, among these."""
    strip: Text
    flight: Text
    """(n,) str. Empty without."""
    time_s: Float
    sequence: Float
    """(n,). Time, and place in the strip."""
