"""Dependent relative orientation: the left image stays fixed, the right one is oriented to it.

Every point measured in both images gives one condition, that base and rays are coplanar,

    b . (u1 x R u2) = 0,   u = (x, y, -c),

weighted by its standard deviation propagated from the image coordinates. Unknowns are the rotation R of the right
image and the direction of the base b; the length of the base is 1. Pairs are the consecutive images of each strip;
images without strip are put in order by their overlaps.
No approximate values are needed. Points with a wrong y-parallax are rejected by data snooping and listed as suspects.

The elements phi2, omega2, kappa2, by/bx and bz/bx of the Chinese system stand in the table `elements` with their
standard deviations. `equation` takes the classical equations with equal weights instead, the y-parallax
q = N1 Y1 - By - N2 Y2 of the model or the triple product itself: for comparison, and to check published examples.

Errors of x of a point in two images cannot be seen here, and left and right cannot be told apart: the suspect names
the right image's measurement.

Source: docs/formulas.md 3.2; see aatri/orientation/relative/dependent.py
and, for the compiled loop over the pairs, pairs.py.
"""

from __future__ import annotations

from aatri.adapters.pairs.pair_methods import PairRules, oriented_pairs
from aatri.adapters.solution import check_same_block
from aatri.adapters.strips.strip_pairs import strip_pairs
from aatri.adjustment.statistics.global_test import MAX_SIGMA0
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.models import Models
from aatri.notes import tell
from aatri.orientation.relative.equal_weights import Equation
from aatri.plugin import SILENT, Context, Field, Options, stage


class DependentOptions(Options):
    """Options of the dependent relative orientation."""

    max_iterations: int = Field(20, ge=1, description="iterations of one adjustment at most")
    snooping_limit: float = Field(
        4.0, gt=0, description="a point is rejected if its y-parallax is wrong by more standard deviations than this"
    )
    min_points: int = Field(5, ge=5, description="a pair with fewer usable common points makes no model")
    max_sigma0: float = Field(MAX_SIGMA0, gt=0, description="a pair whose sigma0 is larger makes no model")
    equation: Equation = Field(
        "rigorous",
        description="rigorous weights; or equal weights of the y-parallax q of the model, or of the determinant",
    )


@stage(version=2, uses=("images.strip",))
def dependent(
    block: Block,
    image_points: ImagePoints,
    *,
    options: DependentOptions = DependentOptions(),
    context: Context = SILENT,
) -> Models:
    """Orient the consecutive images of every strip to each other."""
    check_same_block(block, image_points.images.id, "image_points")
    rules = PairRules(
        options.max_iterations, options.snooping_limit, options.min_points, options.max_sigma0, options.equation
    )
    images, found = strip_pairs(block, image_points)
    tell(found, context)
    models, notes = oriented_pairs(block, image_points, images, "dependent", rules, context)
    tell(notes, context)
    return models
