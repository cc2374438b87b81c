"""Bundle adjustment by alternation of resection and intersection (two-class approximation).

All images are resected on the points, all points intersected from the images, in turn: small problems only, and no
system of normal equations. It makes the same sum of squares smaller as bundle_adjustment/bundle and ends at the same
values, slowly: hundreds of rounds are usual. Converged is what the whole block says: its Newton decrement is below
`tolerance`; else it is an error. There are no standard deviations.

Source: lecture notes A908; aatri/orientation/bundle/alternating.py.
"""

from __future__ import annotations

from aatri.adapters import solution as assemble
from aatri.adjustment.statistics.global_test import MAX_SIGMA0
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.offers import datum_needed
from aatri.artifacts.solution import Solution
from aatri.observations.kinds import with_kinds
from aatri.plugin import SILENT, Context, Field, Options, stage

from ._partial import alternated
from ._uses import used


@with_kinds
class AlternatingOptions(Options):
    """Options of the alternation."""

    max_iterations: int = Field(30, ge=1, description="most iterations")
    tolerance: float = Field(
        1e-3, gt=0, le=1e-2, description="converged when no unknown moves by more than this times its sigma"
    )
    max_sigma0: float = Field(MAX_SIGMA0, gt=1, description="a sigma0 beyond this is an error, not a result")
    max_rounds: int = Field(1000, ge=1, description="most rounds of resection and intersection")


@stage(version=1, uses=used(marked=False, sessions=False), needs=datum_needed())
def alternating(
    block: Block,
    image_points: ImagePoints,
    initial: Solution | None = None,
    *,
    options: AlternatingOptions = AlternatingOptions(),
    context: Context = SILENT,
) -> Solution:
    """Adjust the block by resection and intersection in turn."""
    assemble.check_same_block(block, image_points.images.id, "image_points")
    if initial is not None:
        assemble.check_same_block(block, initial.images.id, "initial")
    return alternated(block, image_points, initial, options, options.max_rounds, context)
