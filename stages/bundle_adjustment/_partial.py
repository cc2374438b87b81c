"""What resection, intersection and alternation share: input, settings, the Solution and what is told."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from aatri.adapters.bundle.bundle_input import bundle_input, observation_source
from aatri.adapters.bundle.bundle_solution import bundle_solution
from aatri.adapters.bundle.bundle_tables import uncontrolled_of
from aatri.adapters.refinement.corrections import without_distortion
from aatri.adapters.suspects import after, inherited
from aatri.adjustment.problem import SolverSettings
from aatri.arrays import Bool, Float, Text, finite_rows
from aatri.artifacts.block import CONTROL, Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.checks.after.left_out import left_out
from aatri.checks.after.sigma0 import sigma0
from aatri.checks.after.uncontrolled import uncontrolled_observations
from aatri.checks.finding import report
from aatri.errors import GeometryError
from aatri.notes import tell
from aatri.observations.kinds.catalogue import options_without_data
from aatri.observations.observed import ObservationSource
from aatri.options import Reliability
from aatri.orientation.bundle.adjust import adjust_bundle
from aatri.orientation.bundle.alternating import adjust_alternating
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.partial import switched_off, with_known_images, with_known_points
from aatri.orientation.bundle.result import BundleResult
from aatri.orientation.bundle.rounds import AdjustedBlock
from aatri.orientation.bundle.settings import BundleSettings
from aatri.plugin import Context

from ._adjusting import AdjustmentOptions


class PartialOptions(AdjustmentOptions):
    """Options of resection and intersection, which have standard deviations."""

    reliability: Reliability = False


def resected(
    block: Block,
    image_points: ImagePoints,
    initial: Solution,
    options: PartialOptions,
    weighted: bool,
    linear: bool,
    context: Context,
) -> Solution:
    """Images on known points; those without orientation start by the linear transformation or three points."""
    image_points = _corrected(block, image_points, context)
    source = observation_source(block, image_points, initial, linear_start=linear)
    inputs = bundle_input(source, options, initial.suspects)
    control = block.ground_points.point[(block.ground_points.role == CONTROL).all(axis=1)]
    fixed = finite_rows(initial.points.xyz_m) | np.isin(np.arange(len(block.points)), control)
    covariance = _covariances(fixed, initial.points.covariance_m2, block.points.id, "point") if weighted else None
    before, inputs = inputs, with_known_points(inputs, fixed & finite_rows(inputs.xyz_m), covariance)
    tell(switched_off(before, inputs), context)
    solution = _made(source, initial, inputs, options, context, "resection", tests=options.reliability)
    if weighted:
        return solution
    # Held is not known without error: what `initial` says of the points holds on.
    return replace(solution, points=replace(solution.points, covariance_m2=initial.points.covariance_m2))


def intersected(
    block: Block,
    image_points: ImagePoints,
    initial: Solution,
    options: PartialOptions,
    weighted: bool,
    context: Context,
) -> Solution:
    """Points from known images."""
    image_points = _corrected(block, image_points, context)
    source = observation_source(block, image_points, initial)
    inputs = bundle_input(source, options, initial.suspects)
    fixed = initial.images.oriented
    covariance = _covariances(fixed, initial.images.covariance, block.images.id, "image") if weighted else None
    before, inputs = inputs, with_known_images(inputs, fixed, covariance)
    tell(switched_off(before, inputs), context)
    solution = _made(source, initial, inputs, options, context, "intersection", tests=options.reliability)
    return (
        solution
        if weighted
        else replace(solution, images=replace(solution.images, covariance=initial.images.covariance))
    )


def alternated(
    block: Block,
    image_points: ImagePoints,
    initial: Solution | None,
    options: AdjustmentOptions,
    rounds: int,
    context: Context,
) -> Solution:
    """Resection and intersection in turn."""
    image_points = _corrected(block, image_points, context)
    source = observation_source(block, image_points, initial)
    block_input = bundle_input(source, options, None if initial is None else initial.suspects)

    def adjust(inputs: BundleInput, settings: BundleSettings) -> BundleResult:
        return adjust_alternating(inputs, replace(settings, covariances=False), max_rounds=rounds, reporter=context)

    return _made(source, initial, block_input, options, context, "alternating", adjust)


def _corrected(block: Block, image_points: ImagePoints, context: Context) -> ImagePoints:
    """None of them carries a lens: what the block says of it is corrected before."""
    corrected, notes = without_distortion(block, image_points)
    tell(notes, context)
    return corrected


def _covariances(fixed: Bool, covariance: Float, ids: Text, what: str) -> Float:
    """The covariances of what is known; an error where they are missing."""
    missing = fixed & ~np.isfinite(covariance).all(axis=(1, 2))
    if missing.any():
        raise GeometryError(
            f"`initial` has no covariance of {int(missing.sum())} {what}s, the first is {ids[missing][0]}",
            remedy="take a bundle with standard deviations as `initial`, or hold what is known (`held`)",
        )
    return covariance


def _made(
    source: ObservationSource,
    initial: Solution | None,
    inputs: BundleInput,
    options: AdjustmentOptions,
    context: Context,
    variant: str,
    adjust: Callable[[BundleInput, BundleSettings], BundleResult] = adjust_bundle,
    *,
    tests: bool = False,
) -> Solution:
    tell([*options_without_data(source.block, options), *(note for o in inputs.observed for note in o.notes)], context)
    suspects, notes = inherited(source.block, initial)
    tell(notes, context)
    settings = BundleSettings(
        solution=SolverSettings(max_iterations=options.max_iterations, tolerance=options.tolerance)
    )
    done = AdjustedBlock(inputs, adjust(inputs, settings))
    result, uncontrolled = done.result, uncontrolled_of(done.result)
    report(
        [
            *result.notes,
            *left_out(inputs, result),
            *sigma0(result, options.max_sigma0, held_unknowns=_held(inputs, result)),
        ],
        context,
    )
    report(uncontrolled_observations(uncontrolled), context)
    return bundle_solution(source, done, after(suspects, done), uncontrolled, variant=variant, tests=tests)


def _held(inputs: BundleInput, result: BundleResult) -> int:
    """Unknowns of points and images held at what an earlier stage has made of image points, perhaps of these."""
    if inputs.rays is None:
        return 0
    rays = np.flatnonzero(result.ray_used)
    points, images = np.unique(inputs.rays.point[rays]), np.unique(inputs.rays.image[rays])
    count = 0 if inputs.held_points is None else 3 * int(inputs.held_points[points].sum())
    return count + (0 if inputs.held_images is None else 6 * int(inputs.held_images[images].sum()))
