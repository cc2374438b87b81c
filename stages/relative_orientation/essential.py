"""Relative orientation without any start: five-point essential matrices, seeded samples, then least squares.

    u1' E u2 = 0,   E = -[b]x R,   det E = 0,   2 E E'E - tr(E E') E = 0,   u = (x, y, -c)

Samples of five points have up to ten essential matrices each, by a polynomial of degree ten; each is judged by all
points with Cauchy's cost of the Sampson distances, the best adjusted with the points that fit it. Samples are drawn by
a generator of fixed seed until one free of gross errors has been among them with probability 0.99999. The best
orientation is adjusted by least squares with data snooping, like `relative_orientation/dependent`.

Nothing is assumed about the angles or the base. Pairs are the consecutive images of strips, or where there are none all
images with at least `min_common` points in common. Where a second orientation explains the points as well (points in a
plane) the model is ambiguous: that is said, and the second one is kept beside it. Images without a base make no model;
their rotation is kept.

Source: Nister, PAMI 26 (2004) 756; Fischler & Bolles 1981; Chum, Matas & Kittler 2003; docs/formulas.md 3.2.
"""

from dataclasses import replace
from typing import Literal

from aatri.adapters.pairs.image_pairs import neighbouring_images, overlapping_images, pairs_of
from aatri.adapters.pairs.models import essential_models, refuse_misfits, with_elements
from aatri.arrays import Int
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.models import Models
from aatri.checks.after.models import findings_of_models
from aatri.checks.finding import report
from aatri.geometry.coplanarity import RayPairs
from aatri.orientation.relative.essential import essential_orientations
from aatri.orientation.relative.from_consensus import SAMPLES
from aatri.orientation.relative.image_scale import with_sigmas
from aatri.orientation.relative.orientations import EssentialOrientations, RelativeOrientations
from aatri.plugin import SILENT, Context, Field, stage

from ._pairs import PairOptions, by_orientation_points, checked_image_points


class EssentialOptions(PairOptions):
    """Options of the relative orientation without start."""

    pairs: Literal["auto", "strips", "all"] = Field(
        "auto",
        description="strips: consecutive images; all: images with `min_common` points in common; auto: strips if given",
    )
    min_common: int = Field(8, ge=5, description="with pairs: all, points in common of a pair")
    max_samples: int = Field(SAMPLES, ge=1, description="most samples of five points of a pair")


@stage(version=1, uses=("images.strip", "cameras.distortion"))
def essential(
    block: Block,
    image_points: ImagePoints,
    *,
    options: EssentialOptions = EssentialOptions(),
    context: Context = SILENT,
) -> Models:
    """Orient pairs of images to each other."""
    image_points = checked_image_points(block, image_points, context)
    by_strips = options.pairs == "strips" or (options.pairs == "auto" and len(block.strips) > 0)
    images = neighbouring_images(block) if by_strips else overlapping_images(block, image_points, options.min_common)[0]
    pairs = pairs_of(block, image_points, images)
    made: EssentialOrientations | None = None

    def orient(rays: RayPairs, start: Int) -> RelativeOrientations:
        nonlocal made
        made = essential_orientations(
            rays,
            start,
            snooping_limit=options.snooping_limit,
            max_iterations=options.max_iterations,
            min_points=options.min_points,
            max_samples=options.max_samples,
            reporter=context,
        )
        return made.orientations

    _, orientations = by_orientation_points(block, pairs, options, orient)
    assert made is not None
    made = replace(made, orientations=orientations)
    refuse_misfits(made.orientations, options.max_sigma0, pairs.rays)
    pairs = replace(pairs, rays=with_sigmas(pairs.rays, made.orientations.scale))
    models = with_elements(essential_models(block, image_points, pairs, made), "dependent")
    context.progress(len(pairs.left), len(pairs.left), "models")
    report(findings_of_models(block, image_points, pairs, made.orientations, models), context)
    return models
