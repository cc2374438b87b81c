"""Dependent relative orientation with the condition of model connection: scales are carried along the strip.

The first model of a strip is oriented as in relative_orientation/dependent. In every following one the scale in units
of the model before is a sixth unknown: a point of both models gives two equations,

    Q: the rays are coplanar with the base,   P: log r_a = s + log r_b,

r its distance from the common projection centre in the model before and in this one; other points give Q alone. Both
have the weights that the image coordinates give them; the error of the model before's own orientation is a latent
unknown with its covariance. Points whose P does not fit are rejected there and listed as suspects of kind model_tie.

phi2, omega2, kappa2, by/bx, bz/bx and `scale` stand in the table `elements`; strip_formation/connected takes the scales
from there. A model without three good connection points keeps its dependent orientation, has no scale, and is told.

Source: docs/formulas.md 3.5, errata E08; see aatri.orientation.strips.connected.py.
"""

from __future__ import annotations

from typing import Literal

from aatri.adapters.pairs.pair_connection import connected_pairs
from aatri.adapters.pairs.pair_methods import PairRules
from aatri.adapters.refinement.systematic import without_distortion
from aatri.adapters.solution import check_same_block
from aatri.adapters.strips.strip_pairs import strip_pairs
from aatri.adjustment.statistics.global_test import MAX_SIGMA0
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.models import Models
from aatri.notes import tell
from aatri.plugin import SILENT, Context, Field, Options, stage


class ConnectedOptions(Options):
    """Options of the connected relative orientation."""

    max_iterations: int = Field(20, ge=1, description="iterations of one adjustment at most")
    snooping_limit: float | None = Field(
        None,
        gt=0,
        description="a point is rejected if its y-parallax is wrong by more standard deviations than this; null: by "
        "the number of points, 4 at least",
    )
    min_points: int = Field(5, ge=5, description="a pair with fewer usable common points makes no model")
    max_sigma0: float = Field(MAX_SIGMA0, gt=0, description="a pair whose sigma0 is larger makes no model")
    coordinates: Literal["intersection", "coefficients"] = Field(
        "intersection",
        description="of the model points: rigorous intersection; or by the point projection coefficients, connection "
        "points from the right image with the height of the model before",
    )


@stage(version=1, uses=("images.strip", "cameras.distortion"))
def connected(
    block: Block,
    image_points: ImagePoints,
    *,
    options: ConnectedOptions = ConnectedOptions(),
    context: Context = SILENT,
) -> Models:
    """Orient the consecutive images of every strip, each model connected with the one before."""
    check_same_block(block, image_points.images.id, "image_points")
    rules = PairRules(
        options.max_iterations, options.snooping_limit, options.min_points, options.max_sigma0,
        coordinates=options.coordinates,
    )  # fmt: skip
    image_points, of_lens = without_distortion(block, image_points)
    images, found = strip_pairs(block, image_points)
    tell([*of_lens, *found], context)
    models, notes = connected_pairs(block, image_points, images, rules, context)
    tell(notes, context)
    return models
