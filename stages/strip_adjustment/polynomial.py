"""Strip block adjustment with polynomials of second degree, all strips at once.

    X = x + G_j (a_j'p, b_j'p, c_j'p),        p = (1, U, V, U^2, U V)

x are the points of strip j brought to the ground by the similarity that `initial` implies, U and V plan coordinates in
the strip's own axes (U along the strip, V across, both in [-1, 1]), G_j turns those axes to the ground. Ground points
in any number of strips, and control, tie the strips together (orientation.strip_polynomials). The degree falls to what
control and ties determine, for plan and height of every strip apart; what fell and why is reported, and the degree
used is the model in `transformations`. Ground points are means over the strips; the orientations of the images follow
by resection on them.

sigma0 is the ratio to the a priori standard deviations of strip points and control; the deformation that the
polynomials leave, in metres, is the parameter tau_m.

Source: strip block adjustment of the Chinese lecture notes (A603, A701-A703), with their errors put right; Kraus,
Photogrammetry.
"""

from __future__ import annotations

import numpy as np

from aatri.adapters import solution as assemble
from aatri.adapters import strips as pieces
from aatri.observations.control import Control, control_of
from aatri.observations.positions import positions_of
from aatri.arrays import Bool, Float
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.artifacts.strips import Strips
from aatri.artifacts.suspects import Suspects
from aatri.errors import GeometryError
from aatri.geometry.polynomials import strip_axes
from aatri.geometry.rotations import nearest_rotation
from aatri.geometry.similarity import Similarity, transform, transform_covariance
from aatri.geometry.vectors import finite_rows
from aatri.ids import shown
from aatri.orientation.free_block import tie_elimination
from aatri.orientation.free_block.component_growth import StripPoints
from aatri.orientation.free_block.strip_polynomials import StripPolynomials, adjust_strip_polynomials, model_name
from aatri.orientation.resection.adjustment import resect_images
from aatri.plugin import SILENT, Context, Field, Options, stage

from ._results import (
    ROLE_NAME,
    Ground,
    residual_tables,
    suspect_tables,
    tie_names,
    transformation_tables,
)


class PolynomialOptions(Options):
    """Options of the strip block adjustment."""

    degree: int = Field(2, ge=0, le=2, description="highest degree; it falls where control and ties determine less")
    limit: float = Field(4.0, gt=0, description="test statistic of a wrong tie or control point, in sigma")


@stage(version=1, uses=("images.strip", "ground_points.xyz_m", "ground_points.covariance_m2"))
def polynomial(
    block: Block,
    image_points: ImagePoints,
    strips: Strips,
    initial: Solution,
    *,
    options: PolynomialOptions = PolynomialOptions(),
    context: Context = SILENT,
) -> Solution:
    """Adjust the strips of a block together."""
    assemble.check_same_block(block, image_points.images.id, "image_points")
    assemble.check_same_block(block, strips.images.id, "strips")
    assemble.check_same_block(block, initial.images.id, "initial")
    control = control_of(block)
    ground = _on_the_ground(strips, initial, control, pieces.origin_of(control, positions_of(block)), context)
    began = _began(block, strips, initial.suspects, ground, control)
    result = adjust_strip_polynomials(
        ground.points,
        len(block.points),
        ground.axes,
        ground.control,
        degree=options.degree,
        active=began,
        limit=options.limit,
    )
    _report(result, ground, strips, context)
    point_m = result.point_m + ground.origin
    position, rotation = _resected(block, image_points, initial, point_m, context)
    return pieces.solution_of(
        block=block,
        image_points=image_points,
        method=f"{ROLE_NAME}/polynomial",
        position_m=position,
        ground_from_image=rotation,
        point_m=point_m,
        counts=(result.tied.observations, result.tied.unknowns),
        sigma0=result.tied.sigma0,
        iterations=result.tied.iterations,
        transformations=transformation_tables(result, ground, strips),
        parameters=pieces.precision_row("all strips", result.tied.tau_m),
        residuals=residual_tables(block, strips, ground, control, result),
        suspects=suspect_tables(block, strips, initial.suspects, ground, control, result, began),
    )


def _on_the_ground(strips: Strips, initial: Solution, control: Control, origin: Float, context: Context) -> Ground:
    images, table = strips.strip_images, pieces.strip_points_of(strips)
    numbers, similarities, axes, parts = [], [], [], []
    for strip in range(len(strips.strips)):
        rows = np.flatnonzero((images.strip == strip) & initial.images.oriented[images.image])
        if len(rows) < 2:
            continue
        image = images.image[rows]
        similarity = _strip_similarity(
            images.position[rows],
            images.strip_from_image[rows],
            initial.images.position_m[image] - origin,
            initial.images.ground_from_image[image],
        )
        of = np.flatnonzero(table.strip == strip)
        xyz = transform(similarity, table.xyz[of])
        parts.append((of, xyz, transform_covariance(similarity, table.covariance[of])))
        axes.append(strip_axes(xyz, transform(similarity, images.position[rows])))
        numbers.append(strip)
        similarities.append(similarity)
    left = sorted(set(range(len(strips.strips))) - set(numbers))
    if left:
        context.warn(f"strips not oriented in `initial`, left out: {shown(strips.strips.id[left])}")
    if not numbers:
        raise GeometryError("`initial` orients no strip", remedy="check `from`: initial wants the absolute orientation")
    rows = np.concatenate([of for of, _, _ in parts])
    points = StripPoints(
        strip=np.repeat(np.arange(len(parts)), [len(of) for of, _, _ in parts]),
        point=table.point[rows],
        xyz=np.concatenate([xyz for _, xyz, _ in parts]),
        covariance=np.concatenate([covariance for _, _, covariance in parts]),
    )
    given = tie_elimination.Control(
        control.point.astype(np.int64),
        control.xyz_m - origin,
        control.covariance_m2,
        control.given,
    )
    return Ground(origin, np.array(numbers), similarities, axes, rows, points, given)


def _strip_similarity(x: Float, strip_from_image: Float, X: Float, ground_from_image: Float) -> Similarity:
    """Ground from strip, of the same images in both: rotation from their attitudes, scale from their distances."""
    rotation = nearest_rotation((ground_from_image @ strip_from_image.swapaxes(1, 2)).sum(0))
    dx, dX = (x - x.mean(0)) @ rotation.T, X - X.mean(0)
    scale = float((dx * dX).sum() / (dx**2).sum())
    return Similarity(X.mean(0) - scale * rotation @ x.mean(0), scale, rotation)


def _began(block: Block, strips: Strips, suspects: Suspects, ground: Ground, control: Control) -> Bool:
    """Observations that no earlier stage has rejected: strip points, then control."""
    strip, point = tie_names(block, strips, ground)
    ties = pieces.rejected_before(suspects, "strip_tie", strip, point)
    ids = block.points.id[control.point]
    return ~np.concatenate([ties, pieces.rejected_before(suspects, "control", np.full(len(ids), ""), ids)])


def _report(result: StripPolynomials, ground: Ground, strips: Strips, context: Context) -> None:
    names = strips.strips.id[ground.strips]
    for strip, name in enumerate(names):
        for part, column in (("plan", 0), ("height", 1)):
            falls = [fall for fall in result.falls if fall.strip == strip and fall.part == part]
            if falls:
                reasons = "; ".join(f"degree {fall.degree + 1}: {fall.reason}" for fall in falls)
                context.warn(f"strip {name}, {part}: {model_name(int(result.degree[strip, column]))}, as {reasons}")
    context.log(f"standard deviation of the strips beyond that of their points: {result.tied.tau_m:.3f} m")


def _resected(
    block: Block, image_points: ImagePoints, initial: Solution, point_m: Float, context: Context
) -> tuple[Float, Float]:
    """Orientations on the adjusted points; where a resection fails the initial orientation stays and is reported."""
    measured = image_points.measurements
    dropped = assemble.rejected_rows(initial.suspects, image_points)
    rows = measured.active & finite_rows(measured.xy_mm) & initial.images.oriented[measured.image] & ~dropped
    found = resect_images(
        measured.xy_mm[rows],
        measured.sigma_mm[rows],
        measured.image[rows],
        measured.point[rows],
        block.cameras.principal_distance_mm[block.images.camera],
        point_m,
        initial.images.position_m,
        initial.images.ground_from_image,
    )
    failed = np.flatnonzero(initial.images.oriented & ~found.resected)
    if len(failed):
        ids = shown(block.images.id[failed])
        context.warn(f"resection failed, initial orientation kept ({len(failed)} of {len(block.images)} images): {ids}")
    left = np.flatnonzero(~initial.images.oriented & block.images.active)
    if len(left):
        context.warn(f"not oriented ({len(left)} of {len(block.images)} images): {shown(block.images.id[left])}")
    return found.position_m, found.ground_from_image
