"""A-posteriori compensation: what the residuals of an adjusted block have in common is taken off its image points.

The residuals of all images of a camera (or session) are laid over each other on the plate; their correlated part is
signal with a covariance function C(d), predicted at every image point by least squares and added to the measurement:

    s^ = c' (C + D)^-1 v,    v adjusted minus observed

Adjust the block again afterwards; each pass compensates the part that orientations and points have not taken up, so it
may be repeated. Residuals without correlated part correct nothing. Method and source:
aatri.orientation.refinement.collocation.
"""

from __future__ import annotations

from typing import Literal

from aatri.adapters.refinement.collocation import compensated
from aatri.adapters.solution import check_same_block
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.notes import tell
from aatri.plugin import SILENT, Context, Field, Options, stage


class CollocationOptions(Options):
    """How the signal is estimated."""

    per: Literal["camera", "session"] = Field("camera", description="whose residuals are laid over each other")
    model: Literal["best", "exponential", "gaussian"] = Field("best", description="covariance function")
    cells_per_side: int = Field(20, ge=4, le=60, description="cells along the longer side of the plate")


@stage(version=1, uses=lambda options: ("images.session",) if options.per == "session" else ())
def collocation(
    block: Block,
    image_points: ImagePoints,
    solution: Solution,
    *,
    options: CollocationOptions = CollocationOptions(),
    context: Context = SILENT,
) -> ImagePoints:
    """Image points less the common part of their residuals in a solution."""
    check_same_block(block, solution.images.id, "solution")
    made, notes = compensated(
        block, image_points, solution, per=options.per, model=options.model, cells_per_side=options.cells_per_side
    )
    tell(notes, context)
    return made
