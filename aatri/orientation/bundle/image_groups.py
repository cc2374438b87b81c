"""What images have in common: camera, strip, flight; errors and standard deviations may be common to them."""

from dataclasses import dataclass

from aatri.arrays import Float, Int, Text


@dataclass(frozen=True)
class ImageGroups:
    """Camera, strip, flight and time of all images.

    Attributes
    ----------
    cameras : (k,) str
        Ids of all cameras.
    corner_mm : (k,) float64, mm
        Half the diagonal of their formats; NaN unknown.
    camera : (n,) int
        Of each image, among these.
    strip, flight : (n,) str
        Empty without.
    time_s, sequence : (n,) float64
        Time, and place in the strip.
    """

    cameras: Text
    corner_mm: Float
    camera: Int
    strip: Text
    flight: Text
    time_s: Float
    sequence: Float
