"""Dependent relative orientation: the left image stays fixed, the right one is oriented to it.

Every point measured in both images gives one condition, that base and rays are coplanar,

    b . (u1 x R u2) = 0,   u = (x, y, -c),

weighted by its standard deviation propagated from the image coordinates. Unknowns are the rotation R of the right
image and the direction of the base b; the length of the base is 1. Pairs are the consecutive images of each strip;
images without strip are put in order by their overlaps.
No approximate values are needed. Points with a wrong y-parallax are rejected by data snooping and listed as suspects.

The elements phi2, omega2, kappa2, by/bx and bz/bx of the Chinese system stand in the table `elements` with their
standard deviations. `equation` takes the classical equations with equal weights instead, the y-parallax
q = N1 Y1 - By - N2 Y2 of the model or the triple product itself: for comparison, and to check published examples.

Errors of x of a point in two images cannot be seen here, and left and right cannot be told apart: the suspect names
the right image's measurement.

Source: docs/formulas.md 3.2; see aatri/orientation/relative/pairs.py.
"""

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.models import Models
from aatri.plugin import SILENT, Context, stage

from ._pairs import ClassicalOptions, oriented


@stage(version=2, uses=("images.strip", "cameras.distortion"))
def dependent(
    block: Block,
    image_points: ImagePoints,
    *,
    options: ClassicalOptions = ClassicalOptions(),
    context: Context = SILENT,
) -> Models:
    """Orient the consecutive images of every strip to each other."""
    return oriented(block, image_points, "dependent", options, context)
