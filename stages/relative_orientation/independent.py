"""Independent relative orientation: both images turn, the base stays along the X axis of the model.

Unknowns are phi1 and kappa1 of the left image, phi2, omega2 and kappa2 of the right one (Chinese system); the base is
(1, 0, 0). Every point measured in both images gives the condition that base and rays are coplanar,

    e_x . (R1 u1 x R2 u2) = 0,   R1 = R(phi1, 0, kappa1),   R2 = R(phi2, omega2, kappa2),   u = (x, y, -c).

With rigorous weights the five angles are another set of parameters of the model that the dependent method finds: the
shape of the model, the y-parallaxes and the statistics are the same, and the angles and their standard deviations
follow exactly from R = R1' R2 and b = R1' e_x. `models` stay in the frame of the left image, as the next stages take
them; the angles stand in the table `elements`. With `equation: q` or `determinant` the equations of equal weight are
formed in the frame along the base, and the model differs from the dependent one.

Pairs, start values, gross errors and what makes no model: as in relative_orientation/dependent.

Source: docs/formulas.md 3.3; see aatri/orientation/relative/elements.py, equal_weights.py and dependent.py.
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


class IndependentOptions(Options):
    """Options of the independent relative orientation."""

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


@stage(version=1, uses=("images.strip",))
def independent(
    block: Block,
    image_points: ImagePoints,
    *,
    options: IndependentOptions = IndependentOptions(),
    context: Context = SILENT,
) -> Models:
    """Orient the consecutive images of every strip, in frames along their bases."""
    check_same_block(block, image_points.images.id, "image_points")
    rules = PairRules(
        options.max_iterations, options.snooping_limit, options.min_points, options.max_sigma0, options.equation
    )
    images, found = strip_pairs(block, image_points)
    tell(found, context)
    models, notes = oriented_pairs(block, image_points, images, "independent", rules, context)
    tell(notes, context)
    return models
