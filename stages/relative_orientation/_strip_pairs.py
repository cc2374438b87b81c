"""Options and call that `dependent` and `independent` share: consecutive images of every strip, pair by pair."""

from __future__ import annotations

from typing import Literal

from aatri.adapters.pairs.pair_methods import PairRules, oriented_pairs
from aatri.adapters.refinement.systematic import without_distortion
from aatri.adapters.solution import check_same_block
from aatri.adapters.strips.strip_pairs import strip_pairs
from aatri.adjustment.statistics.global_test import MAX_SIGMA0
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.models import Models
from aatri.notes import tell
from aatri.orientation.relative.equal_weights import Equation
from aatri.plugin import Context, Field, InputPath, Options


class PairOptions(Options):
    """Options of the relative orientation of single pairs."""

    max_iterations: int = Field(20, ge=1, description="iterations of one adjustment at most")
    snooping_limit: float | None = Field(
        None,
        gt=0,
        description="a point is rejected if its y-parallax is wrong by more standard deviations than this; null: by "
        "the number of points, 4 at least",
    )
    min_points: int = Field(5, ge=5, description="a pair with fewer usable common points makes no model")
    max_sigma0: float = Field(MAX_SIGMA0, gt=0, description="a pair whose sigma0 is larger makes no model")
    orientation_points: InputPath | None = Field(
        None, description="file of the names of the points that orient; the others are intersected; null: all orient"
    )
    equation: Equation = Field(
        "rigorous",
        description="rigorous weights; or equal weights of the y-parallax q of the model, or of the determinant",
    )
    coordinates: Literal["intersection", "coefficients"] = Field(
        "intersection",
        description="of the model points: rigorous intersection; or X and Z from the left image and the mean of "
        "both Y, by the point projection coefficients",
    )


def oriented(block: Block, image_points: ImagePoints, frame: str, options: PairOptions, context: Context) -> Models:
    """Models of the consecutive images of every strip, in the frame of a method."""
    check_same_block(block, image_points.images.id, "image_points")
    rules = PairRules(
        options.max_iterations, options.snooping_limit, options.min_points, options.max_sigma0, options.equation,
        options.coordinates, options.orientation_points,
    )  # fmt: skip
    image_points, of_lens = without_distortion(block, image_points)
    images, found = strip_pairs(block, image_points)
    tell([*of_lens, *found], context)
    models, notes = oriented_pairs(block, image_points, images, frame, rules, context)
    tell(notes, context)
    return models
