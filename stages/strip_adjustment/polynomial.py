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

from __future__ import annotations

from typing import Annotated, Literal

from aatri.adapters.frame.tangent_block import in_tangent_frame
from aatri.adapters.rejection_notes import rejection_notes
from aatri.adapters.solution import check_same_block
from aatri.adapters.strips.strip_adjustment import adjust_strips, strip_block_solution
from aatri.adapters.strips.strip_degrees import highest_degree
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.artifacts.strips import Strips
from aatri.geometry.strip_bases import strip_basis
from aatri.notes import tell
from aatri.plugin import SILENT, Context, Field, Options, stage


class PolynomialOptions(Options):
    """Options of the strip block adjustment."""

    degree: int = Field(2, ge=0, le=3, description="highest degree; it falls where control and ties determine less")
    degrees: dict[str, Annotated[int, Field(ge=0, le=3)]] = Field(
        {}, description="highest degree of single strips, by their ids; the others have `degree`"
    )
    across: Literal["linear", "full"] = Field(
        "linear", description="across the strip: V alone, or V^2 (degree 2), U V^2 and V^3 (degree 3) too"
    )
    limit: float | None = Field(
        None, gt=0, description="test statistic of a wrong tie or control point, in sigma; null: by the number of tests"
    )
    max_sigma0: float | None = Field(
        None,
        gt=0,
        description="an error where strips deform by so many times what their length explains; null: 20, and "
        "off by 0.5 % of the distance",
    )
    reliability: bool = Field(
        False, description="redundancy numbers, test statistics and detectable errors of all observations"
    )


@stage(version=4, uses=("images.strip", "ground_points.xyz_m", "ground_points.covariance_m2",
                       "earth_curvature:frame", "undulation"))  # fmt: skip
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
    check_same_block(block, image_points.images.id, "image_points")
    check_same_block(block, strips.images.id, "strips")
    check_same_block(block, initial.images.id, "initial")
    inside = in_tangent_frame(block, initial)
    block, start = inside.block, inside.initial or initial
    basis = strip_basis("polynomial", highest_degree(options.degree, options.degrees), full=options.across == "full")
    adjusted = adjust_strips(
        block, strips, start, basis, degree=options.degree, degrees=options.degrees,
        asked=bool({"degree", "degrees"} & options.model_fields_set), limit=options.limit,
        max_sigma0=options.max_sigma0,
    )  # fmt: skip
    solution, resected = strip_block_solution(
        block, image_points, strips, start, adjusted, "strip_adjustment/polynomial", tests=options.reliability
    )
    tell([*adjusted.notes, *resected, *rejection_notes(solution.suspects, "strip_adjustment")], context)
    return inside.back(solution)
