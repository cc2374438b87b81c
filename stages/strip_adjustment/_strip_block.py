"""What the strip block adjustments have in common: their options, and how artifacts become a Solution."""

from typing import Annotated

from aatri.adapters.frame.adjustment_frame import in_tangent_frame
from aatri.adapters.solution import check_same_block
from aatri.adapters.strips.strip_adjustment import adjust_strips, strip_block_solution
from aatri.adapters.strips.strip_degrees import highest_degree
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.artifacts.strips import Strips
from aatri.checks.after.of_stage import findings_of
from aatri.checks.finding import report
from aatri.geometry.strip_bases import Form, strip_basis
from aatri.plugin import Context, Field, Options


class StripBlockOptions(Options):
    """Options of a strip block adjustment."""

    degree: int = Field(2, ge=0, le=3, description="highest degree; it falls where control and ties determine less")
    degrees: dict[str, Annotated[int, Field(ge=0, le=3)]] = Field(
        {}, description="highest degree of single strips, by their ids; the others have `degree`"
    )
    limit: float | None = Field(
        None, gt=0, description="test statistic of a wrong tie or control point, in sigma; null: by the number of tests"
    )
    max_sigma0: float | None = Field(
        None,
        gt=0,
        description="an error where strips deform by so many times what their length explains; null: a warning "
        "beyond 20 times",
    )
    reliability: bool = Field(
        False, description="redundancy numbers, test statistics and detectable errors of all observations"
    )


def strip_block(
    block: Block,
    image_points: ImagePoints,
    strips: Strips,
    initial: Solution,
    form: Form,
    options: StripBlockOptions,
    context: Context,
    *,
    full: bool = False,
    narrow: bool = False,
) -> Solution:
    """Adjust the strips of a block together, with deformations of a form."""
    check_same_block(block, image_points=image_points, strips=strips, initial=initial)
    inside = in_tangent_frame(block, initial)
    block, start = inside.block, inside.initial or initial
    basis = strip_basis(form, highest_degree(options.degree, options.degrees), full=full, narrow=narrow)
    adjusted = adjust_strips(
        block,
        strips,
        start,
        basis,
        degree=options.degree,
        degrees=options.degrees,
        degrees_requested=bool({"degree", "degrees"} & options.model_fields_set),
        limit=options.limit,
        max_sigma0=options.max_sigma0,
    )
    method = f"strip_adjustment/{form}"
    solution, resected = strip_block_solution(
        block, image_points, strips, start, adjusted, method, tests=options.reliability
    )
    report([*adjusted.notes, *resected, *findings_of(block, solution, "strip_adjustment", initial.suspects)], context)
    return inside.back(solution)
