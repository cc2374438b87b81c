"""Strip block adjustment: artifacts to strips on the ground, and adjusted strips to a Solution."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from aatri.adapters import solution as assemble
from aatri.adapters.strips import oriented_strips as pieces
from aatri.adapters.strips import tied_tables
from aatri.adapters.strips.oriented_strips import StripsOnGround, strip_notes
from aatri.adjusting.tied_problem import not_rejected
from aatri.adjustment.statistics.limits import SINGLE_LIMIT
from aatri.arrays import Bool, Float, Int, finite_rows
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.artifacts.strips import Strips
from aatri.errors import GeometryError
from aatri.geometry.rotations import nearest_rotation
from aatri.geometry.similarity import Similarity, transform, transform_covariance
from aatri.geometry.strip_bases import StripAxes, StripBasis, strip_axes
from aatri.notes import Note
from aatri.observations.control import KIND as CONTROL
from aatri.observations.control import Control, control_of, origin_of
from aatri.observations.observed import Observed
from aatri.observations.poses import POINT
from aatri.observations.positions import positions_of
from aatri.observations.ties import STRIP_TIE
from aatri.orientation.bodies.absolute_datum import strip_points_of
from aatri.orientation.bodies.component_growth import BodyPoints
from aatri.orientation.bodies.deformation import (
    Misfit,
    distance_m,
    farthest_bodies,
    given_note,
    most_models,
    rms_m,
    search_notes,
    sigma0_notes,
)
from aatri.orientation.bodies.deformed_covariances import DeformedCovariances, covariance_notes, deformed_covariances
from aatri.orientation.bodies.determined_degrees import StripBlockOptions
from aatri.orientation.bodies.free_body import at_a_distance
from aatri.orientation.bodies.strip_polynomials import StripPolynomials, adjust_strip_polynomials, fall_notes
from aatri.orientation.resection.adjustment import resect_images


@dataclass(frozen=True)
class AdjustedStrips:
    """Strips adjusted together; `began` are the observations no earlier stage had rejected."""

    ground: StripsOnGround
    began: Bool
    result: StripPolynomials
    covariances: DeformedCovariances
    notes: tuple[Note, ...]


def on_the_ground(block: Block, strips: Strips, initial: Solution) -> StripsOnGround:
    """Strips as the orientations of `initial` bring them to the ground.

    Raises
    ------
    GeometryError
        If `initial` orients no strip.
    """
    control = control_of(block)
    origin = origin_of(control, positions_of(block).position_m)
    images, table = strips.strip_images, strip_points_of(strips)
    oriented = initial.images.oriented[images.image]
    numbers: list[int] = []
    similarity: list[Similarity] = []
    axes: list[StripAxes] = []
    parts: list[BodyPoints] = []
    rows_of = []
    for strip in range(len(strips.strips)):
        rows = np.flatnonzero((images.strip == strip) & oriented)
        if len(rows) < 2:
            continue
        image = images.image[rows]
        to_ground = _strip_similarity(
            images.position[rows],
            images.strip_from_image[rows],
            initial.images.position_m[image] - origin,
            initial.images.ground_from_image[image],
        )
        of_strip = np.flatnonzero(table.strip == strip)
        of_strip = of_strip[at_a_distance(table.xyz[of_strip], table.covariance[of_strip], images.position[rows])]
        xyz = transform(to_ground, table.xyz[of_strip])
        covariance = transform_covariance(to_ground, table.covariance[of_strip])
        parts.append(BodyPoints(np.full(len(of_strip), len(numbers)), table.point[of_strip], xyz, covariance))
        axes.append(strip_axes(xyz, transform(to_ground, images.position[rows])))
        rows_of.append(of_strip)
        numbers.append(strip)
        similarity.append(to_ground)
    if not numbers:
        raise GeometryError("`initial` orients no strip", remedy="check `from`: initial wants the absolute orientation")
    names = ("strip", "point", "xyz", "covariance")
    points = BodyPoints(*(np.concatenate([getattr(p, name) for p in parts]) for name in names))
    return StripsOnGround(
        origin,
        np.array(numbers),
        similarity,
        axes,
        np.concatenate(rows_of),
        points,
        replace(control, xyz_m=control.xyz_m - origin),
    )


def _strip_similarity(x: Float, strip_from_image: Float, X: Float, ground_from_image: Float) -> Similarity:
    """Ground from strip, of the same images in both: rotation from their attitudes, scale from their distances."""
    rotation = nearest_rotation((ground_from_image @ strip_from_image.swapaxes(1, 2)).sum(0))
    dx, dX = (x - x.mean(0)) @ rotation.T, X - X.mean(0)
    scale = float((dx * dX).sum() / (dx**2).sum())
    return Similarity(X.mean(0) - scale * rotation @ x.mean(0), scale, rotation)


def adjust_strips(
    block: Block, strips: Strips, initial: Solution, basis: StripBasis, options: StripBlockOptions
) -> AdjustedStrips:
    """Adjust the strips that `initial` orients.

    Raises
    ------
    InputError
        If `degrees` names a strip that is not there.
    GeometryError
        If `initial` orients no strip, or something is not determined.
    ConvergenceError
        If the result does not fit.
    """
    ground = on_the_ground(block, strips, initial)
    control, names = ground.control, strips.strips.id[ground.strips]

    def begin(observed: Sequence[Observed]) -> Bool:
        return not_rejected(observed, dict.fromkeys((STRIP_TIE, CONTROL), initial.suspects))

    n_ties = len(ground.points.point)
    models = np.bincount(strips.strip_images.strip, minlength=len(strips.strips))[ground.strips] - 1

    def adjust(
        undoubted: Bool | None = None, after: tuple[Bool, float] | None = None
    ) -> tuple[StripPolynomials, DeformedCovariances]:
        result = adjust_strip_polynomials(
            ground.points,
            len(block.points),
            ground.axes,
            control,
            names=names,
            point_ids=block.points.id,
            degree=options.degrees_of(strips.strips.id)[ground.strips],
            basis=basis,
            begin=begin if undoubted is None else lambda observed: begin(observed) | undoubted,
            limit=options.limit,
            undoubted=undoubted,
            after=after,
        )
        return result, deformed_covariances(result, ground.points, len(block.points), ground.axes, control, models)

    result, deformed = adjust()
    fits = fits_deformed(result, deformed, control)
    notes = []
    if (back := fits & ~result.tied.active[n_ties:]).any():
        ids = tuple(block.points.id[control.point[back]].tolist())
        text = "control that only the deformation of the strips puts off takes part, and is not rejected"
        notes.append(Note("note", text, ids))
        undoubted, after = np.append(np.zeros(n_ties, dtype=bool), fits), (result.tied.active, result.tied.tau_m)
        del result, deformed  # as large as what follows
        result, deformed = adjust(undoubted, after)
        fits = fits_deformed(result, deformed, control)
    # where control that fits is above the limit, so are the ties of its point: it bends them
    bent = np.isin(ground.points.point, control.point[fits & result.tied.above[n_ties:]])
    result = replace(result, tied=replace(result.tied, above=result.tied.above & ~np.append(bent, fits)))
    left = np.setdiff1d(np.arange(len(strips.strips)), ground.strips)
    if len(left):
        text = "strips not oriented in `initial`, left out"
        notes.append(Note("warning", text, tuple(strips.strips.id[left].tolist())))
    notes += fall_notes(result, names.tolist(), "warning" if options.degrees_requested else "note")
    notes += strip_notes(block, strips, ground, result, names)

    tied = result.tied
    text = f"standard deviation of the strips beyond that of their points: {tied.tau_m:.3f} m"
    notes += [Note("note", text), *search_notes(tied, "strip block")]
    away_m = distance_m(initial.images.position_m - ground.origin, ground.points.xyz)
    misfit = Misfit(
        options.max_sigma0, away_m, oriented=True, farthest=farthest_bodies(tied, np.char.add("strip ", names))
    )
    notes += sigma0_notes(
        [tied],
        ["strip block"],
        tied.sigma0,
        most_models(strips),
        misfit,
        rms_m(tied.residuals, tied.active),
        "strip block adjustment",
    )
    of_control = given_note(tied)
    if fits.all():  # their misfit is what such strips may have
        of_control = replace(of_control, level="note")
    notes += [of_control, *covariance_notes(deformed)]
    return AdjustedStrips(ground, begin(tied.problem.observed), result, deformed, tuple(notes))


def fits_deformed(result: StripPolynomials, deformed: DeformedCovariances, control: Control) -> Bool:
    """Control that fits within what the strips may be deformed by, (n,); none where that is not known.

    The search takes the deformation of every tie for an error of its own. That of a strip grows with its length, and
    the covariances of its points count it: control that fits these is no gross error.
    """
    off_m = np.where(control.given, result.point_m[control.point] - control.xyz_m, 0.0)
    C = deformed.point_covariance_m2[control.point] + control.covariance_m2
    within = np.abs(off_m) <= SINGLE_LIMIT * np.sqrt(np.einsum("nii->ni", C))  # false of NaN
    return np.asarray((within | ~control.given).all(axis=1))


def strip_block_solution(
    block: Block,
    image_points: ImagePoints,
    strips: Strips,
    initial: Solution,
    adjusted: AdjustedStrips,
    method: str,
    *,
    tests: bool = False,
) -> tuple[Solution, list[Note]]:
    """The Solution of adjusted strips; the orientations of the images follow by resection."""
    ground, result = adjusted.ground, adjusted.result
    point_m, tied, points = result.point_m + ground.origin, result.tied, ground.points
    bodies = strips.strip_images.strip, strips.strip_images.image
    out = np.flatnonzero(~tied.active[: len(points.point)])
    wrong = rays_of_ties(image_points, *bodies, ground.strips[points.strip[out]], points.point[out])
    position, rotation, notes = resected_on(block, image_points, initial, point_m, wrong)
    sigma_m = adjusted.covariances.coefficient_sigma_m
    solution = tied_tables.solution_of_bodies(
        block,
        image_points,
        pieces.Placed(position, rotation, point_m),
        tied,
        method=method,
        names=strips.strips.id[ground.strips],
        began=adjusted.began,
        initial=initial,
        unseen=strips.uncontrolled,
        transformations=pieces.transformation_tables(result, ground, strips, sigma_m),
        point_covariance_m2=adjusted.covariances.point_covariance_m2,
        at={**tied.state, POINT: result.point_m},
        tests=tests,
    )
    return solution, notes


def rays_of_ties(image_points: ImagePoints, body: Int, image: Int, tied_body: Int, tied_point: Int) -> Bool:
    """Image points of which ties are made, (n,): those of a tie's point in the images of its body.

    Parameters
    ----------
    body, image : (k,) int
        Bodies, and the images they are made of.
    tied_body, tied_point : (m,) int
    """
    measured, n = image_points.measurements, int(tied_point.max(initial=0)) + 1
    keys = [image[body == b].astype(np.int64) * n + p for b, p in zip(tied_body, tied_point)]
    keys_of_rays = np.where(measured.point < n, measured.image.astype(np.int64) * n + measured.point, -1)
    return np.isin(keys_of_rays, np.concatenate([np.zeros(0, dtype=np.int64), *keys]))


def resected_on(
    block: Block, image_points: ImagePoints, initial: Solution, point_m: Float, wrong: Bool
) -> tuple[Float, Float, list[Note]]:
    """Orientations on the adjusted points, without the image points of rejected ties, `wrong`, (n,).

    Where a resection fails the initial orientation stays and is reported.
    """
    measured = image_points.measurements
    dropped = wrong | assemble.rejected_rows(initial.suspects, image_points)
    rows = measured.active & finite_rows(measured.xy_mm) & initial.images.oriented[measured.image] & ~dropped
    resected = resect_images(
        measured.xy_mm[rows],
        measured.sigma_mm[rows],
        measured.image[rows],
        measured.point[rows],
        block.cameras.principal_distance_mm[block.images.camera],
        point_m,
        initial.images.position_m,
        initial.images.ground_from_image,
    )
    notes = []
    failed = np.flatnonzero(initial.images.oriented & ~resected.resected)
    if len(failed):
        text = f"resection failed, initial orientation kept ({len(failed)} of {len(block.images)} images)"
        notes.append(Note("warning", text, tuple(block.images.id[failed].tolist())))
    notes += pieces.left_out(block, initial.images.oriented)
    return resected.position_m, resected.ground_from_image, notes
