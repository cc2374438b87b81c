"""Resection of all images on known ground points.

    x = -c u1 / u3,   y = -c u2 / u3,   u = R'(X - X0)           X known, X0 and R of every image unknown

Points are those of `initial`, and control. `points: held`: each image for itself, exact points; `weighted`: the points
are observations with the covariances of `initial`, and corrected together with the images. Images without orientation
in `initial` get a closed robust start (three-point problem) from the known points, or with `start: linear` that of the
direct linear transformation. Points that are not known take no part, and are named. Observed positions and attitudes
of the images take part as in the bundle.

Source: Kraus, Photogrammetry 1; aatri/orientation/bundle/partial.py, orientation/resection/start.py.
"""

from typing import Literal

from aatri.adapters.solution import check_same_block
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.plugin import SILENT, Context, Field, stage

from ._partial import PartialOptions, resected
from ._uses import used


class ResectionOptions(PartialOptions):
    """Options of the resection."""

    points: Literal["held", "weighted"] = Field(
        "held", description="known points: held at their values, or observed with the covariances of `initial`"
    )
    start: Literal["closed", "linear"] = Field(
        "closed",
        description="images without orientation: closed three-point problem, robust; linear: direct linear "
        "transformation of six and more points not in a plane, else closed",
    )


@stage(version=1, uses=used(marked=False, sessions=False))
def resection(
    block: Block,
    image_points: ImagePoints,
    initial: Solution,
    *,
    options: ResectionOptions = ResectionOptions(),
    context: Context = SILENT,
) -> Solution:
    """Orient the images on known points."""
    check_same_block(block, image_points=image_points, initial=initial)
    return resected(
        block, image_points, initial, options, options.points == "weighted", options.start == "linear", context
    )
