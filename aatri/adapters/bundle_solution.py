"""From an adjusted bundle to a Solution."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aatri.adapters import solution as assemble
from aatri.adapters.calibration_tables import CalibrationTables
from aatri.observations.control import Control
from aatri.observations.positions import Positions
from aatri.adjustment.statistics.reliability import Reliability, reliability
from aatri.arrays import Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.solution import (
    Iterations,
    Orderings,
    Parameters,
    Residuals,
    Solution,
    SolvedCameras,
    StripTransformations,
    Tests,
)
from aatri.artifacts.suspects import Suspects
from aatri.geometry.rotations import skew
from aatri.observations.poses import CAMERA
from aatri.orientation.bundle.adjust import BundleResult
from aatri.orientation.bundle.block import BundleInput


def bundle_solution(
    block: Block, control: Control, positions: Positions, given: BundleInput, result: BundleResult,
    suspects: Suspects, parameters: Sequence[Parameters], calibration: CalibrationTables | None = None,
    orderings: Orderings | None = None, *, tests: bool = False,
) -> Solution:  # fmt: skip
    """Orientations, points, cameras, parameters, residuals and history of an adjusted block; `tests` if wanted."""
    adjusted, used = result.adjusted, result.ray_used
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
        cameras=_cameras(block, result),
        transformations=StripTransformations.empty(),
        parameters=assemble.stacked([Parameters.empty(), *parameters]),
        residuals=_residuals(block, control, positions, given, result),
        history=Iterations(
            cost=np.array([s.cost for s in adjusted.history]),
            decrement=np.array([s.decrement for s in adjusted.history]),
            damping=np.array([s.damping for s in adjusted.history]),
        ),
        suspects=suspects,
        tests=_tests(control, positions, given, result) if tests else None,
        calibrated_sets=calibration.sets if calibration else None,
        parameter_covariances=calibration.covariances if calibration else None,
        error_fields=calibration.fields if calibration else None,
        orderings=orderings,
    )


def _cameras(block: Block, result: BundleResult) -> SolvedCameras:
    """Cameras as given, with the adjusted principal distance and point of their models."""
    cameras = assemble.solved_cameras(block)
    for p in result.parameters:
        if p.given.group != CAMERA:
            continue
        row = {str(k): i for i, k in enumerate(block.cameras.id)}
        c, point = cameras.principal_distance_mm.copy(), cameras.principal_point_mm.copy()
        for name, model, value in zip(p.given.ids, p.given.model, p.value):
            k = row[str(name)]
            c[k] = value[0]
            if model != "bal":
                first = 1 if model in ("pinhole", "brown") else 2
                point[k] += value[first : first + 2]
        cameras = replace(cameras, principal_distance_mm=c, principal_point_mm=point)
    return cameras


def _residuals(
    block: Block, control: Control, positions: Positions, given: BundleInput, result: BundleResult
) -> Residuals:
    by_name = {r.name: r for r in result.adjusted.problem.records}
    used = np.flatnonzero(result.ray_used)
    rays = given.rays
    parts = [
        assemble.residuals("image_point", used, block.images.id[rays.image[used]], block.points.id[rays.point[used]],
                           by_name["image point"].residuals(result.adjusted.state), rays.sigma_mm[used]),
    ]  # fmt: skip
    known = np.flatnonzero(result.point_adjusted[control.point])
    if len(known):
        there = control.given[known]
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


def _tests(control: Control, positions: Positions, given: BundleInput, result: BundleResult) -> Tests:
    """Reliability of all observations, in the order of the residuals."""
    by_name = {r.name: r for r in result.adjusted.problem.records}
    used = np.flatnonzero(result.ray_used)
    sigma = given.rays.sigma_mm[used]
    variance = sigma[:, :, None] * np.eye(2) * sigma[:, None, :]
    hat = sigma[:, :, None] * result.ray_covariance[used] * sigma[:, None, :]
    parts = [_table(reliability(by_name["image point"].residuals(result.adjusted.state), variance, hat))]
    known = np.flatnonzero(result.point_adjusted[control.point])
    if len(known):
        parts.append(_control_tests(control, known, result))
    if "position" in by_name:
        seen = np.flatnonzero(result.image_adjusted[positions.image])
        image = positions.image[seen]
        arm = np.einsum("nij,nj->ni", result.poses.ground_from_image[image], positions.lever_arm_m[seen])
        J = np.concatenate([np.broadcast_to(np.eye(3), (len(seen), 3, 3)), -skew(arm)], axis=2)
        adjusted = J @ result.pose_covariance[image] @ J.swapaxes(1, 2)
        v = by_name["position"].residuals(result.adjusted.state)
        parts.append(_table(reliability(v, positions.covariance_m2[seen], adjusted)))
    return assemble.stacked(parts)


def _control_tests(control: Control, known: Int, result: BundleResult) -> Tests:
    """Reliability of the observed control coordinates; exact ones have none."""
    observed = control.observed[known]
    both = observed[:, :, None] & observed[:, None, :]
    v = np.where(observed, result.xyz_m[control.point[known]] - control.xyz_m[known], 0.0)
    covariance = np.where(both, control.covariance_m2[known], np.eye(3))
    adjusted = np.where(both, result.point_covariance_m2[control.point[known]], 0.0)
    found = reliability(v, covariance, adjusted)
    return Tests(
        redundancy=np.where(observed, found.redundancy, np.nan),
        test=np.where(observed, found.test, np.nan),
        detectable=np.where(observed, found.detectable, np.nan),
    )


def _table(found: Reliability) -> Tests:
    def wide(values: Float) -> Float:
        return np.pad(values, ((0, 0), (0, 3 - values.shape[1])), constant_values=np.nan)

    return Tests(redundancy=wide(found.redundancy), test=wide(found.test), detectable=wide(found.detectable))
