"""Initial orientation from the graph of image pairs: orbits, oblique heads, crossing strips, hovering, gaps.

    distances   those of open cameras with which the rotations of pairs fit each other around triangles
    rotations   R_right = R_left R_pair                 all at once: least absolute deviations, then reweighted
    bases       log s_b - log s_a = log l_a - log l_b   median of the points that two pairs share in a common image
    positions   v = d (X - c), d >= 0                   directions of rays, robustly, from bases, GNSS or anywhere
    points      intersected, rays that do not fit trimmed; a robust bundle without datum; trimmed and adjusted again
    ground      X = T + s R x                           one similarity from all control, observed positions and
                                                        distances; attitudes where these leave something open

Neither strips nor an order of the images nor any start value is used. Pairs are all images with at least `min_points`
points in common, and of images that these do not join those with at least 6; with `models` those are taken and no
others. Components that share enough points are joined; what
stays apart is listed by its ids. Without control and positions the datum is free: attitudes turn it, distances scale
it, and without these the first base is 1. What control and positions leave open the approximate coordinates of the
points marked `datum: yes` close, all of it where there are neither.

Source: Chatterjee & Govindu 2018 (rotations); Zhuang, Cheong & Lee 2018, Pan et al. 2024 (positions); Kraus,
Photogrammetry (absolute orientation).
"""

from dataclasses import replace
from typing import Literal

import numpy as np

from aatri.adapters.bundle.block_start import given_orientations
from aatri.adapters.frame.adjustment_frame import geodesy_of, in_tangent_frame
from aatri.adapters.ground.initial_solution import initial_solution, shown_components
from aatri.adapters.pairs.image_pairs import joining_pairs, overlapping_images, pairs_of, strongest_pairs
from aatri.adapters.pairs.models import essential_models, graph_of, turns_of
from aatri.adapters.refinement.corrections import without_distortion
from aatri.adapters.solution import check_same_block
from aatri.adapters.strips.oriented_strips import left_out
from aatri.arrays import Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.models import Models
from aatri.artifacts.solution import Solution
from aatri.checks.after.of_stage import findings_of
from aatri.checks.finding import report
from aatri.errors import GeometryError
from aatri.ids import several
from aatri.notes import Note
from aatri.observations.image_points import rays_of
from aatri.observations.positions import positions_of
from aatri.options import Reliability
from aatri.orientation.bodies.ground_observed import USES, ground_observed
from aatri.orientation.graph.component_bodies import principal_distance_shares
from aatri.orientation.graph.free_images import orient_free
from aatri.orientation.graph.limits import FEWEST_POINTS
from aatri.orientation.graph.pair_graph import PairGraph
from aatri.orientation.graph.principal_distance import with_bends
from aatri.orientation.graph.to_ground import to_ground
from aatri.orientation.relative.essential import essential_orientations
from aatri.orientation.relative.from_consensus import SAMPLES
from aatri.orientation.relative.orientations import EssentialOrientations
from aatri.orientation.relative.shared_planes import rotations_by_planes
from aatri.plugin import SILENT, Context, Field, Options, stage

from ._starting_distances import SAMPLES_ON_TRIAL, starting_distances, with_distances


class GraphOptions(Options):
    """Options of the initial orientation."""

    min_points: int = Field(
        8, ge=6, description="images with fewer points in common are a pair only where no others join them"
    )
    pairs_per_image: int | None = Field(
        None,
        ge=3,
        description="of each image only the pairs of most common points, and any of fewer than `min_points`; null: all",
    )
    snooping_limit: float = Field(4.0, gt=0, description="a point of a pair is rejected beyond this test statistic")
    positions: Literal["bases", "gnss", "random"] = Field(
        "bases",
        description="start of the projection centres: bases with their lengths, observed positions, or anywhere",
    )
    control_limit: float = Field(
        5.0, gt=0, description="test statistic of wrong control, positions, distances and attitudes, in sigma"
    )
    use_positions: bool = Field(True, description="use observed positions of the projection centres")
    reliability: Reliability = False


@stage(
    version=5,
    uses=("cameras.distortion", "ground_points.datum", *USES),
)
def graph(
    block: Block,
    image_points: ImagePoints,
    models: Models | None = None,
    *,
    options: GraphOptions = GraphOptions(),
    context: Context = SILENT,
    rng: np.random.Generator,
) -> Solution:
    """Orient all images."""
    check_same_block(block, image_points=image_points, models=models)
    image_points, of_lens = without_distortion(block, image_points)
    factor, of_distances = np.ones(len(block.cameras)), list[Note]()
    if models is None:
        images = _pairs(block, image_points, options, context)
        limit = options.snooping_limit
        factor, of_distances = starting_distances(
            block,
            image_points,
            images,
            lambda b, points, pairs: _models(b, points, pairs, limit, SILENT, SAMPLES_ON_TRIAL),
        )
        models = _models(with_distances(block, factor), image_points, images, limit, context)
    pairs = graph_of(models, options.min_points, FEWEST_POINTS)
    _refuse_without_pairs(block, image_points, pairs)
    inside = in_tangent_frame(block)
    rays = rays_of(inside.block, image_points)
    rays = replace(rays, c_mm=rays.c_mm * factor[block.images.camera[rays.image]])
    observed = _observed_positions(inside.block) if options.use_positions else np.full((len(block.images), 3), np.nan)
    free = orient_free(
        pairs,
        turns_of(models),
        rays,
        block.images.id,
        block.points.id,
        start=options.positions,
        observed_m=observed,
        rng=rng,
        reporter=context,
    )
    geodesy = geodesy_of(block, inside.frame)
    ground = ground_observed(block, inside.block, inside.frame, geodesy, use_positions=options.use_positions)
    shares = principal_distance_shares(inside.block, rays)
    components = tuple(with_bends(c, rays, shares, block.images.id, block.points.id) for c in free.components)
    parts, notes = to_ground(ground, components, rays, options.control_limit)
    solution = initial_solution(
        inside.block,
        image_points,
        rays,
        ground.origin_m,
        parts,
        image_points.suspects,
        tests=options.reliability,
    )
    findings = findings_of(inside.block, solution, "initial_orientation")
    report(
        [
            *of_lens,
            *of_distances,
            *free.notes,
            *shown_components(components, inside.block),
            *notes,
            *findings,
            *left_out(inside.block, solution.images.oriented),
        ],
        context,
    )
    return inside.back(solution)


def _refuse_without_pairs(block: Block, image_points: ImagePoints, pairs: PairGraph) -> None:
    measured = np.unique(block.image_points.image[block.image_points.active])
    if len(measured) == 1:
        raise GeometryError(
            "one image makes no pair",
            where=f"image {block.images.id[measured[0]]}",
            remedy="leave out this stage and `initial`: bundle_adjustment/bundle orients an image by four control "
            "points or more",
        )
    if not len(pairs.left):
        most = int(overlapping_images(block, image_points, 1)[1].max(initial=0))
        raise GeometryError(
            f"no two images have {FEWEST_POINTS} points in common that fit, seen along a base",
            remedy="measure more points that several images have in common "
            f"(two images share {most} at most); "
            "check the ids of images and points; images all taken at one place make no model",
        )


def _observed_positions(block: Block) -> Float:
    """Of each image, (n, 3), m; NaN where none is observed."""
    positions, observed = positions_of(block), np.full((len(block.images), 3), np.nan)
    observed[positions.image] = positions.position_m
    return observed


def _pairs(block: Block, image_points: ImagePoints, options: GraphOptions, context: Context) -> Int:
    """Pairs of images that are oriented, (m, 2)."""
    images, common = overlapping_images(block, image_points, FEWEST_POINTS)
    joining = joining_pairs(images, common, len(block.images), options.min_points, FEWEST_POINTS)
    images, common = images[joining], common[joining]
    if options.pairs_per_image is None:
        return images
    kept = strongest_pairs(images, common, len(block.images), options.pairs_per_image, options.min_points)
    context.log(
        f"{int(kept.sum())} of {len(images)} pairs are oriented: those of most common points of each image, "
        "and those that join what no others join"
    )
    return images[kept]


def _models(
    block: Block,
    image_points: ImagePoints,
    images: Int,
    snooping_limit: float,
    context: Context,
    max_samples: int = SAMPLES,
) -> Models:
    """Relative orientations of pairs."""
    pairs, (_, turned) = pairs_of(block, image_points, images), given_orientations(block)

    def oriented(expected: Float) -> EssentialOrientations:
        return essential_orientations(
            pairs.rays,
            pairs.start,
            snooping_limit=snooping_limit,
            min_points=FEWEST_POINTS,
            max_samples=max_samples,
            expected=expected,
            reporter=context,
        )

    expected = turned[pairs.left].swapaxes(1, 2) @ turned[pairs.right]
    orientations = oriented(expected)
    by_planes, others = rotations_by_planes(pairs.left, pairs.right, pairs.rays, pairs.start, orientations)
    if others:
        context.log(
            f"{several(others, 'pair', 'is', 'are')} oriented anew: over a plane, which their neighbours see otherwise"
        )
        orientations = oriented(np.where(np.isfinite(by_planes), by_planes, expected))
    context.progress(len(images), len(images), "models")
    context.log(f"{int(orientations.orientations.formed.sum())} of {len(images)} pairs make a model")
    return essential_models(block, image_points, pairs, orientations)
