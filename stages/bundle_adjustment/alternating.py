"""Bundle adjustment by alternation of resection and intersection (two-class approximation).

All images are resected on the points, all points intersected from the images, in turn: small problems only, and no
system of normal equations. It makes the same sum of squares smaller as bundle_adjustment/bundle and ends at the same
values, slowly: hundreds of rounds are usual. Converged is what the whole block says: its Newton decrement is below
`tolerance`; else it is an error. There are no standard deviations.

Source: lecture notes A908; aatri/orientation/bundle/alternating.py.
"""

from aatri.adapters.solution import check_same_block
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.needed_datum import datum_needed
from aatri.artifacts.solution import Solution
from aatri.plugin import SILENT, Context, Field, stage

from ._adjusting import AdjustmentOptions
from ._partial import alternated
from ._uses import used


class AlternatingOptions(AdjustmentOptions):
    """Options of the alternation."""

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
    check_same_block(block, image_points=image_points, initial=initial)
    return alternated(block, image_points, initial, options, options.max_rounds, context)
