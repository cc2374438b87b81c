"""Strip adjustment with conformal polynomials in plan and a polynomial in height, of one strip or a whole block.

    dU + i dV = sum (a_k + i b_k) z^k,   z = (U + i V) / half length,   dW = c'p,   p = (1; U, V; U^2, U V; U^3, U^2 V)

Plan is bent without change of angles (Cauchy-Riemann): 6 coefficients for degree 2, 8 for degree 3, beside 5 and 7 of
the height, where the general polynomial has 15 and 21. Fewer coefficients need less control and extrapolate less
wildly; errors of a strip that are not conformal stay. `narrow: true` drops the terms with V^2 and V^3, as the lecture
notes do for narrow strips. All else (ties, control, the fall of the degree, sigma0): see strip_adjustment/polynomial.

Source: lecture notes A604 with errata E05 and E06; Schut 1967; aatri/geometry/strip_bases.py.
"""

from __future__ import annotations

from typing import Annotated

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


class ConformalOptions(Options):
    """Options of the strip block adjustment."""

    degree: int = Field(2, ge=0, le=3, description="highest degree; it falls where control and ties determine less")
    degrees: dict[str, Annotated[int, Field(ge=0, le=3)]] = Field(
        {}, description="highest degree of single strips, by their ids; the others have `degree`"
    )
    narrow: bool = Field(False, description="without the terms in V^2 and V^3 of the plan: conformal on the axis only")
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


@stage(version=2, uses=("images.strip", "ground_points.xyz_m", "ground_points.covariance_m2",
                       "earth_curvature:frame", "undulation"))  # fmt: skip
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
    check_same_block(block, image_points.images.id, "image_points")
    check_same_block(block, strips.images.id, "strips")
    check_same_block(block, initial.images.id, "initial")
    inside = in_tangent_frame(block, initial)
    block, start = inside.block, inside.initial or initial
    basis = strip_basis("conformal", highest_degree(options.degree, options.degrees), narrow=options.narrow)
    adjusted = adjust_strips(
        block, strips, start, basis, degree=options.degree, degrees=options.degrees,
        asked=bool({"degree", "degrees"} & options.model_fields_set), limit=options.limit,
        max_sigma0=options.max_sigma0,
    )  # fmt: skip
    solution, resected = strip_block_solution(
        block, image_points, strips, start, adjusted, "strip_adjustment/conformal", tests=options.reliability
    )
    tell([*adjusted.notes, *resected, *rejection_notes(solution.suspects, "strip_adjustment")], context)
    return inside.back(solution)
