"""Bundle block adjustment: poses and ground points from all rays together.

    x = -c u1 / u3,   y = -c u2 / u3,   u = R'(X - X0)

Unknowns: X0 and R of every image (R <- exp([d]x) R), X of every point; exact control is held, weighted control and
GNSS positions (X0 + R a, a the lever arm) are observed. Points are eliminated one by one; the reduced normal equations
are solved by Gauss-Newton with Levenberg-Marquardt fall-back until the Newton decrement is below 1e-3. Standard
deviations follow from the exact inverse, a priori (sigma0 = 1).

With `interior_unknowns` each film image carries six more unknowns, the affine film correction that its fiducials leave
open, weighted by the covariance of its interior orientation.

Start: `initial` if given, else the orientations of the block itself; images and points without a start get one by
resection and intersection. What an earlier stage rejected stays out unless it fits the adjusted block after all.

Source: Kraus, Photogrammetry; Chinese lecture notes on the bundle method, with their errors put right.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from aatri.artifacts import assemble
from aatri.artifacts.block import CHECK, Block
from aatri.artifacts.given import Control, Positions, control_of, given_orientations, positions_of
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Iterations, Parameters, Residuals, Solution, StripTransformations
from aatri.artifacts.suspects import Suspects
from aatri.errors import GeometryError
from aatri.evaluation.statistics import sigma0_fits, sigma0_interval
from aatri.geometry.vectors import finite_rows
from aatri.ids import shown
from aatri.observations.image_points import ImagePointRows
from aatri.observations.poses import Poses
from aatri.orientation.bundle import BundleInput, BundleResult, ControlRows, PositionRows, adjust_bundle
from aatri.orientation.bundle_start import complete_start
from aatri.orientation.readmission import readmitted
from aatri.plugin import SILENT, Context, Field, Options, stage

Float = npt.NDArray[np.float64]
Bool = npt.NDArray[np.bool_]


class BundleOptions(Options):
    """Options of the bundle adjustment."""

    max_iterations: int = Field(30, ge=1, description="most iterations")
    interior_unknowns: bool = Field(
        False, description="carry the affine film correction of each image as weighted unknowns"
    )
    use_positions: bool = Field(True, description="use observed positions of the projection centres")
    standard_deviations: bool = Field(True, description="compute standard deviations of all orientations and points")


@stage(version=1)
def bundle(
    block: Block,
    image_points: ImagePoints,
    initial: Solution | None = None,
    *,
    options: BundleOptions = BundleOptions(),
    context: Context = SILENT,
) -> Solution:
    """Adjust the block."""
    assemble.check_same_block(block, image_points.images.id, "image_points")
    if initial is not None:
        assemble.check_same_block(block, initial.images.id, "initial")
    control = control_of(block)
    positions = positions_of(block) if options.use_positions else _no_positions(positions_of(block))
    suspects = initial.suspects if initial is not None else Suspects.empty()
    given = _input(block, image_points, initial, control, positions, options)
    rejected = assemble.rejected_rows(suspects, image_points)
    given, result, suspects = _adjusted_with_readmission(given, rejected, suspects, options, context)
    _report_left_out(block, given, result, context)
    _report_misfit(result, context)
    return _solution(block, control, positions, given, result, suspects)


def _adjusted_with_readmission(
    given: BundleInput, rejected: Bool, suspects: Suspects, options: BundleOptions, context: Context
) -> tuple[BundleInput, BundleResult, Suspects]:
    """Adjust without what was rejected, then once more with those of it that fit."""

    def run(problem: BundleInput) -> BundleResult:
        return adjust_bundle(
            problem,
            max_iterations=options.max_iterations,
            covariances=options.standard_deviations,
            reporter=context,
        )

    all_rays = given.rays
    without = replace(given, rays=replace(all_rays, active=all_rays.active & ~rejected))
    result = run(without)
    fits = readmitted(all_rays, rejected & all_rays.active, result)
    if not fits.any():
        return without, result, suspects
    context.log(f"{int(fits.sum())} of {int(rejected.sum())} rejected image points fit the block and are re-admitted")
    again = replace(given, rays=replace(all_rays, active=all_rays.active & (~rejected | fits)))
    back = (suspects.kind == "image_point") & (suspects.row >= 0) & fits[suspects.row]
    verdict = np.where(back, "readmitted", suspects.verdict)
    return again, run(again), replace(suspects, verdict=verdict)


def _no_positions(positions: Positions) -> Positions:
    nothing = np.zeros(0, dtype=np.int64)
    return Positions(positions.row[nothing], positions.image[nothing], positions.position_m[nothing],
                     positions.covariance_m2[nothing], positions.lever_arm_m[nothing])  # fmt: skip


def _input(
    block: Block, image_points: ImagePoints, initial: Solution | None, control: Control, positions: Positions,
    options: BundleOptions,
) -> BundleInput:  # fmt: skip
    m = image_points.measurements
    camera = block.images.camera[m.image]
    rays = ImagePointRows(
        m.image,
        m.point,
        m.xy_mm,
        m.sigma_mm,
        block.cameras.principal_distance_mm[camera],
        block.cameras.principal_point_mm[camera],
        m.active & finite_rows(m.xy_mm),
    )
    poses, xyz = complete_start(rays, _start_poses(block, initial), _start_points(block, initial))
    prior = None
    if options.interior_unknowns:
        prior = np.zeros((len(block.images), 6, 6))
        prior[image_points.interior.image] = image_points.interior.covariance
    return BundleInput(
        block.images.id,
        block.points.id,
        rays,
        poses,
        xyz,
        ControlRows(control.point, control.xyz_m, control.covariance_m2, control.observed, control.held),
        PositionRows(positions.image, positions.position_m, positions.covariance_m2, positions.lever_arm_m),
        prior,
    )


def _start_poses(block: Block, initial: Solution | None) -> Poses:
    if initial is not None:
        return Poses(initial.images.position_m, initial.images.ground_from_image)
    position, rotation = given_orientations(block)
    if not (finite_rows(position) & finite_rows(rotation)).any():
        raise GeometryError(
            "no image has a starting orientation",
            where=f"block {block.name}",
            remedy="give `initial` in `from:`, or positions and angles in exterior.csv",
        )
    return Poses(position, rotation)


def _start_points(block: Block, initial: Solution | None) -> Float:
    if initial is not None:
        return initial.points.xyz_m
    xyz = np.full((len(block.points), 3), np.nan)
    xyz[block.ground_points.point] = np.where(block.ground_points.role == CHECK, np.nan, block.ground_points.xyz_m)
    return xyz


def _report_left_out(block: Block, given: BundleInput, result: BundleResult, context: Context) -> None:
    seen = np.bincount(given.rays.point[given.rays.active], minlength=len(block.points)) > 0
    points = block.points.id[seen & ~result.point_adjusted]
    images = block.images.id[block.images.active & ~result.image_adjusted]
    if len(points):
        context.warn(f"left out, too few usable rays ({len(points)} of {len(block.points)} points): {shown(points)}")
    if len(images):
        context.warn(
            f"left out, no start or too few points ({len(images)} of {len(block.images)} images): {shown(images)}"
        )


def _report_misfit(result: BundleResult, context: Context) -> None:
    sigma0, redundancy = result.adjusted.sigma0, result.adjusted.redundancy
    if not sigma0_fits(sigma0, redundancy):
        low, high = sigma0_interval(redundancy)
        why = "gross errors, an effect not modelled, or standard deviations that are too small"
        if sigma0 < low:
            why = "standard deviations that are too large"
        context.warn(
            f"sigma0 {sigma0:.3f}, expected {low:.3f} to {high:.3f} (95 %): {why}; "
            "the standard deviations of the result are as wrong"
        )


def _solution(
    block: Block, control: Control, positions: Positions, given: BundleInput,
    result: BundleResult, suspects: Suspects,
) -> Solution:  # fmt: skip
    adjusted = result.adjusted
    used = result.ray_used
    per_image = np.bincount(given.rays.image[used], minlength=len(block.images))
    per_point = np.bincount(given.rays.point[used], minlength=len(block.points))
    rms_sigma_um = 1e3 * float(np.sqrt((given.rays.sigma_mm[used] ** 2).mean()))
    return Solution(
        method="bundle_adjustment/bundle",
        observations=adjusted.observations,
        unknowns=adjusted.n_unknowns,
        redundancy=adjusted.redundancy,
        sigma0=adjusted.sigma0,
        sigma0_um=adjusted.sigma0 * rms_sigma_um,
        iterations=len(adjusted.history),
        images=assemble.oriented_images(
            block, result.poses.position_m, result.poses.ground_from_image, per_image, result.pose_covariance
        ),
        points=assemble.ground_points(block, result.xyz_m, per_point, result.point_covariance_m2),
        cameras=assemble.solved_cameras(block),
        transformations=StripTransformations.empty(),
        parameters=_interior_parameters(block, result),
        residuals=_residuals(block, control, positions, given, result),
        history=Iterations(
            cost=np.array([s.cost for s in adjusted.history]),
            decrement=np.array([s.decrement for s in adjusted.history]),
            damping=np.array([s.damping for s in adjusted.history]),
        ),
        suspects=suspects,
    )


def _interior_parameters(block: Block, result: BundleResult) -> Parameters:
    if result.interior is None or result.interior_covariance is None:
        return Parameters.empty()
    variance = np.einsum("nii->ni", result.interior_covariance)
    rows = np.flatnonzero((np.nan_to_num(variance) > 0).all(axis=1))
    return Parameters(
        group=np.full(6 * len(rows), "interior"),
        object=np.repeat(block.images.id[rows], 6),
        name=np.tile([f"d{k}" for k in range(6)], len(rows)),
        value=result.interior[rows].ravel(),
        sigma=np.sqrt(variance[rows]).ravel(),
    )


def _residuals(
    block: Block, control: Control, positions: Positions, given: BundleInput, result: BundleResult
) -> Residuals:
    by_name = {r.name: r for r in result.adjusted.problem.records}
    used = np.flatnonzero(result.ray_used)
    v_rays = by_name["image point"].residuals(result.adjusted.state)
    rays = given.rays
    parts = [
        assemble.residuals("image_point", used, block.images.id[rays.image[used]], block.points.id[rays.point[used]],
                           v_rays, rays.sigma_mm[used]),
    ]  # fmt: skip
    known = np.flatnonzero(result.point_adjusted[control.point])
    if len(known):
        there = control.observed[known] | control.held[known]
        v = np.where(there, result.xyz_m[control.point[known]] - control.xyz_m[known], np.nan)
        sigma = np.where(there, np.sqrt(np.einsum("nii->ni", control.covariance_m2[known])), np.nan)
        names = block.points.id[control.point[known]]
        parts.append(assemble.residuals("control", control.row[known], np.full(len(known), ""), names, v, sigma))
    if "position" in by_name:
        seen = np.flatnonzero(result.image_adjusted[positions.image])
        v = by_name["position"].residuals(result.adjusted.state)
        sigma = np.sqrt(np.einsum("nii->ni", positions.covariance_m2[seen]))
        names = block.images.id[positions.image[seen]]
        parts.append(assemble.residuals("position", positions.row[seen], names, np.full(len(seen), ""), v, sigma))
    return assemble.stacked(parts)
