"""What the variants share: options, the pairs of the strips, and what becomes of their orientations."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Literal

import numpy as np

from aatri.adapters.pairs.image_pairs import named_points, pairs_of, strip_pairs
from aatri.adapters.pairs.models import models_of, refuse_misfits, with_elements
from aatri.adapters.refinement.corrections import without_distortion
from aatri.adapters.solution import check_same_block
from aatri.arrays import Bool, Int
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.models import Models
from aatri.checks.after.models import findings_of_models
from aatri.checks.finding import report
from aatri.geometry.coplanarity import RayPairs
from aatri.notes import Note, tell
from aatri.orientation.relative.connected_pairs import classical_model_points
from aatri.orientation.relative.equal_weights import Equation, with_equal_weights
from aatri.orientation.relative.image_scale import limit_of, with_sigmas
from aatri.orientation.relative.orientations import ImagePairs, RelativeOrientations
from aatri.orientation.relative.pairs import oriented_by, relative_orientations
from aatri.plugin import Context, Field, InputPath, Options


class PairOptions(Options):
    """Options of the adjustment of pairs."""

    max_iterations: int = Field(20, ge=1, description="iterations of one adjustment at most")
    snooping_limit: float | None = Field(
        None,
        gt=0,
        description="a point is rejected if its y-parallax is wrong by more standard deviations than this; null: by "
        "the number of points, 4 at least",
    )
    min_points: int = Field(5, ge=5, description="a pair with fewer usable common points makes no model")
    max_sigma0: float | None = Field(
        None,
        gt=0,
        description="a pair whose sigma0 is larger makes no model; null: 20, or 1 mrad over the stated standard "
        "deviation of a direction where that is more",
    )
    orientation_points: InputPath | None = Field(
        None, description="file of the names of the points that orient; the others are intersected; null: all orient"
    )


class ClassicalOptions(PairOptions):
    """Options of the relative orientation of single pairs."""

    equation: Equation = Field(
        "rigorous",
        description="rigorous weights; or equal weights of the y-parallax q of the model, or of the determinant",
    )
    coordinates: Literal["intersection", "coefficients"] = Field(
        "intersection",
        description="of the model points: rigorous intersection; or X and Z from the left image and the mean of "
        "both Y, by the point projection coefficients",
    )


def checked_image_points(block: Block, image_points: ImagePoints, context: Context) -> ImagePoints:
    """The image points of the block, without distortion."""
    check_same_block(block, image_points=image_points)
    image_points, notes = without_distortion(block, image_points)
    tell(notes, context)
    return image_points


def pairs_of_strips(block: Block, image_points: ImagePoints, context: Context) -> ImagePairs:
    """Consecutive images of every strip."""
    images, notes = strip_pairs(block, image_points)
    tell(notes, context)
    return pairs_of(block, image_points, images)


def by_orientation_points(
    block: Block, pairs: ImagePairs, options: PairOptions, orient: Callable[[RayPairs, Int], RelativeOrientations]
) -> tuple[Bool, RelativeOrientations]:
    """Which points orient, (n,), all or those named, and the orientations by them; the others are intersected."""
    if options.orientation_points is None:
        return np.ones(len(pairs.point), dtype=bool), orient(pairs.rays, pairs.start)
    orients = named_points(options.orientation_points, block.points.id)[pairs.point]
    return orients, oriented_by(pairs, orients, limit_of(pairs.rays, options.snooping_limit), orient)


def oriented_pairs(
    block: Block, image_points: ImagePoints, options: PairOptions, context: Context
) -> tuple[ImagePairs, Bool, RelativeOrientations]:
    """Consecutive images of every strip, with sigmas as they fit; which points orient, (n,); the orientations."""
    pairs = pairs_of_strips(block, image_points, context)
    orient = partial(
        relative_orientations,
        snooping_limit=options.snooping_limit,
        max_iterations=options.max_iterations,
        min_points=options.min_points,
        reporter=context,
    )
    orients, orientations = by_orientation_points(block, pairs, options, orient)
    return replace(pairs, rays=with_sigmas(pairs.rays, orientations.scale)), orients, orientations


def oriented(
    block: Block, image_points: ImagePoints, frame: str, options: ClassicalOptions, context: Context
) -> Models:
    """Models of the consecutive images of every strip, in the frame of a method, dependent or independent."""
    image_points = checked_image_points(block, image_points, context)
    pairs, orients, orientations = oriented_pairs(block, image_points, options, context)
    if options.equation != "rigorous" and orientations.formed.any():
        with_equal_weights(pairs, orientations, options.equation, frame, orients)
        text = f"orientations by equal weights of the equation {options.equation}; points were rejected by the rigorous"
        tell([Note("note", f"{text} one")], context)
    refuse_misfits(orientations, options.max_sigma0, with_sigmas(pairs.rays, 1.0 / orientations.scale))
    if options.coordinates == "coefficients":
        orientations.xyz[:] = classical_model_points(pairs, orientations)
    models = with_elements(models_of(block, image_points, pairs, orientations), frame)
    context.progress(len(pairs.left), len(pairs.left), "models")
    report(findings_of_models(block, image_points, pairs, orientations, models), context)
    return models
