"""What the strip block adjustments have in common: their options, and how artifacts become a Solution."""

from aatri.adapters.frame.adjustment_frame import in_tangent_frame
from aatri.adapters.solution import check_same_block
from aatri.adapters.strips.strip_adjustment import adjust_strips, strip_block_solution
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.artifacts.strips import Strips
from aatri.checks.after.of_stage import findings_of
from aatri.checks.finding import report
from aatri.geometry.strip_bases import Form, strip_basis
from aatri.orientation.bodies.determined_degrees import StripBlockOptions
from aatri.plugin import Context


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
    basis = strip_basis(form, options.highest_degree, full=full, narrow=narrow)
    adjusted = adjust_strips(block, strips, start, basis, options)
    method = f"strip_adjustment/{form}"
    solution, resected = strip_block_solution(
        block, image_points, strips, start, adjusted, method, tests=options.reliability
    )
    report([*adjusted.notes, *resected, *findings_of(block, solution, "strip_adjustment", initial.suspects)], context)
    return inside.back(solution)
