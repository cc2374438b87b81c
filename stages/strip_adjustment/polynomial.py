"""Strip adjustment with polynomials, of a single strip or all strips of a block at once.

    X = x + G_j (a_j'p, b_j'p, c_j'p),        p = (1; U, V; U^2, U V; U^3, U^2 V)   of degree 0; 1; 2; 3

x are the points of strip j brought to the ground by the similarity that `initial` implies, U and V plan coordinates in
the strip's own axes (U along the strip, V across, both in [-1, 1]), G_j turns those axes to the ground. Ground points
in any number of strips, and control, tie the strips together (orientation.bodies.strip_polynomials). The degree
falls to what control and ties determine, for plan and height of every strip apart; what fell and why is reported, and
the degree used is the model in `transformations`. Ground points are means over the strips; the orientations of the
images follow by resection on them.

sigma0 is the ratio to the a priori standard deviations of strip points and control; the deformation that the
polynomials leave, in metres, is the parameter tau_m; with it in the standard deviations sigma0 is tested, and that of
control alone (orientation.bodies.deformation).

Source: strip block adjustment of the Chinese lecture notes (A603, A701-A703), with their errors put right; Kraus,
Photogrammetry.
"""

from typing import Literal

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.artifacts.strips import Strips
from aatri.orientation.bodies.determined_degrees import StripBlockOptions
from aatri.plugin import SILENT, Context, Field, stage

from ._strip_block import strip_block


class PolynomialOptions(StripBlockOptions):
    """Options of the strip block adjustment."""

    across: Literal["linear", "full"] = Field(
        "linear", description="across the strip: V alone, or V^2 (degree 2), U V^2 and V^3 (degree 3) too"
    )


@stage(
    version=4,
    uses=("images.strip", "ground_points.xyz_m", "ground_points.covariance_m2", "earth_curvature:frame", "undulation"),
)
def polynomial(
    block: Block,
    image_points: ImagePoints,
    strips: Strips,
    initial: Solution,
    *,
    options: PolynomialOptions = PolynomialOptions(),
    context: Context = SILENT,
) -> Solution:
    """Adjust the strips of a block together."""
    return strip_block(
        block, image_points, strips, initial, "polynomial", options, context, full=options.across == "full"
    )
