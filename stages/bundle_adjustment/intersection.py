"""Intersection of all ground points from known orientations.

    x = -c u1 / u3,   y = -c u2 / u3,   u = R'(X - X0)           X0 and R known, X of every point unknown

Orientations are those of `initial`. `orientations: held`: each point for itself, from all its rays, least squares with
its covariance; `weighted`: the orientations are observations with the covariances of `initial`. Points start from the
place nearest to all their rays. Control and other observations of points take part as in the bundle; positions and
attitudes say nothing of a known orientation, and take none.

Source: Kraus, Photogrammetry 1; aatri/orientation/bundle/partial.py, geometry/intersection.py.
"""

from typing import Literal

from aatri.adapters.solution import check_same_block
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.plugin import SILENT, Context, Field, stage

from ._partial import PartialOptions, intersected
from ._uses import used


class IntersectionOptions(PartialOptions):
    """Options of the intersection."""

    orientations: Literal["held", "weighted"] = Field(
        "held", description="known orientations: held, or observed with the covariances of `initial`"
    )


@stage(version=1, uses=used(marked=False, sessions=False))
def intersection(
    block: Block,
    image_points: ImagePoints,
    initial: Solution,
    *,
    options: IntersectionOptions = IntersectionOptions(),
    context: Context = SILENT,
) -> Solution:
    """Determine the points from known orientations."""
    check_same_block(block, image_points=image_points, initial=initial)
    return intersected(block, image_points, initial, options, options.orientations == "weighted", context)
