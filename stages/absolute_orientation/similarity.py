"""Absolute orientation by similarities: free strips to each other, then each component to the ground.

    component: X_c = T_j + s_j R_j x_j   for every strip j, by common points
    ground:    X   = T + s R X_c         by all control of the component together

Strips are first joined by common points to free components (orientation.bodies); each component then gets one
robust similarity from all its control points - full, plan only, height only - and observed positions of its projection
centres (orientation.bodies.absolute). So a block with four corner points, where no strip has three, is oriented.
What control leaves open is named. Control that no strip holds, as two images of different strips see it, is intersected
from its rays in the component. A strip that fits neither control nor the others is taken by itself, or left out by
name; where `max_sigma0` is given it is an error instead.

`start: centroids` shows the classical solution: with a = s R (x - x0) reduced to the centroid the normal matrix

    N = diag( W I,  sum w (|a|^2 I - a a'),  sum w |a|^2 )       of shift (3), rotation (3) and scale (1)

falls apart, as sum w a = 0; each part is solved by itself, and the result is that of all seven together.

sigma0 is the ratio to the a priori standard deviations of strip points and control: how much more the strips are
deformed than the precision of their points explains. The deformation itself, in metres, is the parameter tau_m; with it
in the standard deviations sigma0 is tested (orientation.bodies.deformation).

Source: Horn 1987, Umeyama 1991; Kraus, Photogrammetry, block adjustment with independent models.
"""

from dataclasses import replace
from typing import Literal

from aatri.adapters.frame.adjustment_frame import geodesy_of, in_tangent_frame
from aatri.adapters.ground.absolute_solution import absolute_solution, tp_rows
from aatri.adapters.solution import check_same_block, stacked
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.needed_datum import datum_needed
from aatri.artifacts.solution import Solution
from aatri.artifacts.strips import Strips
from aatri.checks.after.of_stage import findings_of
from aatri.checks.after.rejections import control_left_behind
from aatri.checks.at_start.orientations import unlikely_orientations
from aatri.checks.finding import report
from aatri.options import Reliability
from aatri.orientation.bodies.absolute import Start
from aatri.orientation.bodies.absolute_datum import StripsOfBlock
from aatri.orientation.bodies.absolute_orientation import Joining, orient_strips
from aatri.orientation.bodies.ground_observed import USES, ground_observed
from aatri.plugin import SILENT, Context, Field, Options, stage


class SimilarityOptions(Options):
    """Options of the absolute orientation."""

    components: Literal["all", "largest"] = Field(
        "largest",
        description="largest: orient what can be, list the rest; all: an error if a component cannot be oriented",
    )
    start: Start = Field(
        "closed",
        description="closed: of all full control; two_points: levelled, and turned to the two control points farthest "
        "apart, the frame tp of the lecture notes; centroids: from there by all full control, reduced to the centroid; "
        "the adjustment that follows is the same",
    )
    tie_limit: float = Field(6.0, gt=0, description="test statistic of a wrong tie between strips, in sigma")
    control_limit: float = Field(5.0, gt=0, description="test statistic of wrong control, in sigma")
    use_positions: bool = Field(True, description="use observed positions of the projection centres")
    max_sigma0: float | None = Field(
        None,
        gt=0,
        description="an error where strips deform by so many times what their length explains; null: a warning beyond "
        "20, and an error where they are off by 5 % of the distance too",
    )
    reliability: Reliability = False


@stage(
    version=2,
    uses=("images.strip", *USES),
    needs=lambda options: datum_needed(positions=options.use_positions),
)
def similarity(
    block: Block,
    strips: Strips,
    image_points: ImagePoints,
    *,
    options: SimilarityOptions = SimilarityOptions(),
    context: Context = SILENT,
) -> Solution:
    """Orient free strips to the ground."""
    check_same_block(block, strips=strips, image_points=image_points)
    inside = in_tangent_frame(block)
    geodesy = geodesy_of(block, inside.frame)
    ground = ground_observed(block, inside.block, inside.frame, geodesy, use_positions=options.use_positions)
    oriented = orient_strips(
        StripsOfBlock(inside.block, ground, strips, image_points),
        Joining(
            options.tie_limit,
            options.control_limit,
            start=options.start,
            every_component=options.components == "all",
        ),
        max_sigma0=options.max_sigma0,
    )
    method = "absolute_orientation/similarity"
    solution, left_out = absolute_solution(oriented, image_points, method, tests=options.reliability)
    findings = findings_of(inside.block, solution, "absolute_orientation")
    findings += control_left_behind(block, solution, strips.suspects)
    solution = inside.back(solution)
    if options.start != "closed" and oriented.parts:
        frame_tp = tp_rows(block, strips, oriented.parts[0])
        if not len(frame_tp):
            context.warn("no frame tp: fewer than two control points known in X, Y and Z lie in the largest component")
        solution = replace(solution, transformations=stacked([solution.transformations, frame_tp]))
    images = solution.images
    findings += unlikely_orientations(block, images.position_m, images.ground_from_image, solution.points.xyz_m)
    report([*oriented.notes, *left_out, *findings], context)
    return solution
