"""Strip adjustment with conformal polynomials in plan and a polynomial in height, of one strip or a whole block.

    dU + i dV = sum (a_k + i b_k) z^k,   z = (U + i V) / half length,   dW = c'p,   p = (1; U, V; U^2, U V; U^3, U^2 V)

Plan is bent without change of angles (Cauchy-Riemann): 6 coefficients for degree 2, 8 for degree 3, beside 5 and 7 of
the height, where the general polynomial has 15 and 21. Fewer coefficients need less control and extrapolate less
wildly; errors of a strip that are not conformal stay. `narrow: true` drops the terms with V^2 and V^3, as the lecture
notes do for narrow strips. All else (ties, control, the fall of the degree, sigma0): see strip_adjustment/polynomial.

Source: lecture notes A604 with errata E05 and E06; Schut 1967; aatri/geometry/strip_bases.py.
"""

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.artifacts.strips import Strips
from aatri.orientation.bodies.determined_degrees import StripBlockOptions
from aatri.plugin import SILENT, Context, Field, stage

from ._strip_block import strip_block


class ConformalOptions(StripBlockOptions):
    """Options of the strip block adjustment."""

    narrow: bool = Field(False, description="without the terms in V^2 and V^3 of the plan: conformal on the axis only")


@stage(
    version=2,
    uses=("images.strip", "ground_points.xyz_m", "ground_points.covariance_m2", "earth_curvature:frame", "undulation"),
)
def conformal(
    block: Block,
    image_points: ImagePoints,
    strips: Strips,
    initial: Solution,
    *,
    options: ConformalOptions = ConformalOptions(),
    context: Context = SILENT,
) -> Solution:
    """Adjust the strips of a block together."""
    return strip_block(block, image_points, strips, initial, "conformal", options, context, narrow=options.narrow)
