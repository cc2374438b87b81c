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

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from aatri.artifacts import assemble
from aatri.artifacts import strip_solution as pieces
from aatri.artifacts.block import Block
from aatri.artifacts.given import Control, control_of, positions_of
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Residuals, Solution, StripTransformations
from aatri.artifacts.strips import Strips
from aatri.artifacts.suspects import Suspects
from aatri.errors import GeometryError
from aatri.geometry.polynomials import COUNT, StripAxes, strip_axes
from aatri.geometry.rotations import nearest_rotation
from aatri.geometry.similarity import Similarity, transform, transform_covariance
from aatri.geometry.vectors import finite_rows
from aatri.ids import shown
from aatri.orientation import tie_elimination
from aatri.orientation.free_block import StripPoints
from aatri.orientation.resection import resect_images
from aatri.orientation.strip_polynomials import StripPolynomials, adjust_strip_polynomials, model_name, terms_of
from aatri.plugin import SILENT, Context, Field, Options, stage

Float = npt.NDArray[np.float64]
Int = npt.NDArray[np.int64]
Bool = npt.NDArray[np.bool_]

ROLE_NAME = "strip_adjustment"


class PolynomialOptions(Options):
    """Options of the strip block adjustment."""

    degree: int = Field(2, ge=0, le=2, description="highest degree; it falls where control and ties determine less")
    limit: float = Field(4.0, gt=0, description="test statistic of a wrong tie or control point, in sigma")


@dataclass(frozen=True)
class _Ground:
    """Oriented strips on the ground, reduced to the origin."""

    origin: Float
    strips: Int
    similarity: list[Similarity]
    axes: list[StripAxes]
    rows: Int
    points: StripPoints
    control: tie_elimination.Control


@stage(version=1)
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
        transformations=_transformations(result, ground, strips),
        parameters=pieces.precision_row("all strips", result.tied.tau_m),
        residuals=_residuals(block, strips, ground, control, result),
        suspects=_suspects(block, strips, initial.suspects, ground, control, result, began),
    )


def _on_the_ground(strips: Strips, initial: Solution, control: Control, origin: Float, context: Context) -> _Ground:
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
        pieces.given_coordinates(control),
    )
    return _Ground(origin, np.array(numbers), similarities, axes, rows, points, given)


def _strip_similarity(x: Float, strip_from_image: Float, X: Float, ground_from_image: Float) -> Similarity:
    """Ground from strip, of the same images in both: rotation from their attitudes, scale from their distances."""
    rotation = nearest_rotation((ground_from_image @ strip_from_image.swapaxes(1, 2)).sum(0))
    dx, dX = (x - x.mean(0)) @ rotation.T, X - X.mean(0)
    scale = float((dx * dX).sum() / (dx**2).sum())
    return Similarity(X.mean(0) - scale * rotation @ x.mean(0), scale, rotation)


def _began(block: Block, strips: Strips, suspects: Suspects, ground: _Ground, control: Control) -> Bool:
    """Observations that no earlier stage has rejected: strip points, then control."""
    strip, point = _tie_names(block, strips, ground)
    ties = pieces.rejected_before(suspects, "strip_tie", strip, point)
    ids = block.points.id[control.point]
    return ~np.concatenate([ties, pieces.rejected_before(suspects, "control", np.full(len(ids), ""), ids)])


def _tie_names(block: Block, strips: Strips, ground: _Ground) -> tuple[npt.NDArray[np.str_], npt.NDArray[np.str_]]:
    return strips.strips.id[ground.strips[ground.points.strip]], block.points.id[ground.points.point]


def _report(result: StripPolynomials, ground: _Ground, strips: Strips, context: Context) -> None:
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
        context.warn(f"{len(failed)} images keep their initial orientation, too few points to resect them: {ids}")
    left = np.flatnonzero(~initial.images.oriented & block.images.active)
    if len(left):
        context.warn(f"{len(left)} images are not oriented: {shown(block.images.id[left])}")
    return found.position_m, found.ground_from_image


def _transformations(result: StripPolynomials, ground: _Ground, strips: Strips) -> StripTransformations:
    """Per strip: the similarity, the axes, and the coefficients a of dU, b of dV, c of dW in metres."""
    tables = [StripTransformations.empty()]
    for k, strip in enumerate(ground.strips):
        name, axes = str(strips.strips.id[strip]), ground.axes[k]
        tables.append(pieces.similarity_rows(name, ground.similarity[k], ground.origin))
        plan, height = (int(degree) for degree in result.degree[k])
        tables.append(
            pieces.transformation_rows(
                name,
                model_name(max(plan, height)),
                ("origin_X_m", "origin_Y_m", "origin_Z_m", "half_range_U_m", "half_range_V_m", "azimuth_of_U_rad"),
                [
                    *(axes.origin_m + ground.origin),
                    *axes.half_range_m,
                    np.arctan2(axes.ground_from_axes[0, 0], axes.ground_from_axes[1, 0]),
                ],
            )
        )
        for axis, degree in enumerate((plan, plan, height)):
            names = tuple(f"{'abc'[axis]}_{term}" for term in terms_of(degree))
            count = COUNT[degree]
            tables.append(
                pieces.transformation_rows(
                    name,
                    model_name(degree),
                    names,
                    result.coefficients_m[k, axis, :count],
                    result.sigma_m[k, axis, :count],
                )
            )
    return assemble.stacked(tables)


def _residuals(block: Block, strips: Strips, ground: _Ground, control: Control, result: StripPolynomials) -> Residuals:
    """Adjusted minus given at control, the strips' mean minus the single strip at ties."""
    n = len(ground.rows)
    given = pieces.given_coordinates(control)
    strip, point = _tie_names(block, strips, ground)
    shared = np.flatnonzero(np.bincount(ground.points.point, minlength=len(block.points))[ground.points.point] > 1)
    at_control = result.point_m[control.point] - ground.control.xyz_m
    known = np.flatnonzero(finite_rows(result.point_m[control.point]))
    return assemble.stacked([
        assemble.residuals(
            "control", control.row[known], np.full(len(known), ""), block.points.id[control.point[known]],
            np.where(given, at_control, np.nan)[known],
            np.where(given, np.sqrt(np.einsum("nii->ni", control.covariance_m2)), np.nan)[known],
            result.tied.active[n:][known],
        ),
        assemble.residuals(
            "strip_tie", np.full(len(shared), -1), strip[shared], point[shared],
            (result.point_m[ground.points.point] - result.corrected_m)[shared],
            np.sqrt(np.einsum("nii->ni", ground.points.covariance))[shared], result.tied.active[:n][shared],
        ),
    ])  # fmt: skip


def _suspects(
    block: Block,
    strips: Strips,
    before: Suspects,
    ground: _Ground,
    control: Control,
    result: StripPolynomials,
    began: Bool,
) -> Suspects:
    n = len(ground.rows)
    strip, point = _tie_names(block, strips, ground)
    tied, m = result.tied, len(control.row)
    return assemble.stacked([
        pieces.carried_on(before, "strip_tie", "control"),
        pieces.tested(kind="strip_tie", row=np.full(n, -1), image=strip, point=point, stage=ROLE_NAME,
                      size_m=tied.size_m[:n], test=tied.test[:n], began=began[:n], active=tied.active[:n]),
        pieces.tested(kind="control", row=control.row, image=np.full(m, ""), point=block.points.id[control.point],
                      stage=ROLE_NAME, size_m=tied.size_m[n:], test=tied.test[n:], began=began[n:],
                      active=tied.active[n:]),
    ])  # fmt: skip
