"""Bundle block adjustment: all rays of all images together.

Unknowns are the poses of the images (X0, d), the ground points, which are eliminated point by point, and where wanted
further parameters: film corrections per image, sets of additional parameters, parameters of camera models. Observations
are image points (collinearity), control coordinates, observed positions, and the priors of the weighted parameters.
Exact control coordinates are held. Coordinates are reduced to an origin near the block before any arithmetic.

Source: Kraus, Photogrammetry; photogrammetry.md A901-A910, A1101-A1107.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from time import perf_counter
from typing import Literal

import numpy as np

from aatri.adjustment.adjust import Adjusted, adjust_large
from aatri.adjustment.covariance.marginal import marginal_covariances
from aatri.adjustment.forecast import Solver, forecast
from aatri.adjustment.loss import Huber
from aatri.adjustment.records import Records
from aatri.adjustment.structure.index_problem import Ordering
from aatri.adjustment.unknowns import State, Unknowns, add_step
from aatri.arrays import Bool, Float
from aatri.observations.coordinates import value_records
from aatri.observations.image_points import (
    CameraRows,
    ImagePointRows,
    LinearCorrection,
    image_point_records,
    side_veto,
)
from aatri.observations.poses import CAMERA, POINT, POSE, Poses, pose_unknowns
from aatri.observations.positions import position_records
from aatri.orientation.bundle.block import BundleInput, ParameterRows, determinable
from aatri.orientation.bundle.free_datum import FreeDatum, free_covariances, minimally_held, onto_inner_constraints
from aatri.progress import SILENT, Reporter

Datum = Literal["given", "minimal", "free"]
DatumOver = Literal["points", "images", "marked"]


@dataclass(frozen=True)
class AdjustedParameters:
    """A group of parameters after the adjustment.

    Attributes
    ----------
    given : ParameterRows
    value : (n, s) float64
    covariance : (n, s, s) float64
        NaN where not asked for; zero where held.
    """

    given: ParameterRows
    value: Float
    covariance: Float


@dataclass(frozen=True)
class BundleResult:
    """An adjusted block.

    Attributes
    ----------
    poses : Poses
        NaN where the image was left out.
    xyz_m : (n_points, 3) float64, m
    pose_covariance : (n_images, 6, 6) float64, m and rad
    point_covariance_m2 : (n_points, 3, 3) float64, m^2
        NaN where not determined or not asked for.
    parameters : tuple of AdjustedParameters
    ray_covariance : (n, 2, 2) float64
        Covariance of the adjusted image coordinates over the a-priori standard deviations: its diagonal is 1 minus the
        redundancy numbers; NaN unknown.
    ray_used : (n,) bool
    image_adjusted, point_adjusted : bool
    adjusted : Adjusted
    """

    poses: Poses
    xyz_m: Float
    pose_covariance: Float
    point_covariance_m2: Float
    parameters: tuple[AdjustedParameters, ...]
    ray_covariance: Float
    ray_used: Bool
    image_adjusted: Bool
    point_adjusted: Bool
    adjusted: Adjusted


def adjust_bundle(
    given: BundleInput,
    *,
    datum: Datum = "given",
    datum_over: DatumOver = "points",
    max_iterations: int = 30,
    tolerance: float = 1e-3,
    covariances: bool = True,
    huber: float | None = None,
    ordering: Ordering = "auto",
    threads: int | None = None,
    reproducible: bool = False,
    memory_gb: float | None = None,
    solver: Solver = "auto",
    reporter: Reporter = SILENT,
) -> BundleResult:
    """Adjust a block.

    Parameters
    ----------
    given : BundleInput
    datum : str
        `given` by control and positions, or `minimal`: the pose of the first image and one coordinate of the image
        farthest from it are held at their start, which changes no residual of a block without any datum; or `free`:
        inner constraints for what control and positions leave open, see `free_datum`.
    datum_over : str
        What a free datum rests on: all points, the projection centres of all images, or the marked points.
    max_iterations : int
    tolerance : float
        Bound of the Newton decrement.
    covariances : bool
        There are none where image points are down-weighted.
    huber : float, optional
        Bound of Huber's loss of the image points, in their standard deviations; see `aatri.adjustment.loss`.
    ordering, threads, reproducible
        See `aatri.adjustment.structure.index_problem`.
    memory_gb, solver
        See `aatri.adjustment.forecast`.
    reporter : Reporter

    Raises
    ------
    GeometryError
        If unknowns are not determined; the message names them.
    ConvergenceError
        If the iteration does not converge.
    """
    ray, image, point = determinable(given)
    origin = np.round(given.xyz_m[point].mean(axis=0)) if point.any() else np.zeros(3)
    rays = given.rays if ray.all() else given.rays.take(ray)
    parameters = given.parameters if ray.all() else tuple(p.take(ray) for p in given.parameters)
    start = {
        POSE: Poses(given.poses.position_m - origin, given.poses.ground_from_image),
        POINT: _start_points(given, origin),
        **{p.group: p.start for p in parameters},
    }
    unknowns = _unknowns(given, parameters, _free_poses(given, image, datum), point, _places(given, ordering))
    records = _records(given, rays, parameters, origin, image, point, huber)
    free = _free_datum(given, unknowns, records[1:], start, image, point, datum_over) if datum == "free" else None
    adjusted = adjust_large(
        unknowns if free is None else minimally_held(free),
        records,
        start,
        max_iterations=max_iterations,
        tolerance=tolerance,
        veto=side_veto(rays),
        ordering=ordering,
        threads=threads,
        reproducible=reproducible,
        memory_gb=memory_gb,
        solver=solver,
        reporter=reporter,
    )
    if free is not None:
        adjusted = onto_inner_constraints(free, adjusted)
    covariances = covariances and not adjusted.down_weighted
    if covariances and adjusted.problem.subtrees is not None:
        needed = forecast(adjusted.problem)
        reporter.warn(_WITHOUT_FACTOR.format(needed.memory_bytes(spill=True) / 1e9, needed.factor_bytes / 1e9))
        covariances = False
    started = perf_counter()
    result = _result(given, adjusted, origin, (ray, image, point), covariances, free)
    if covariances:
        reporter.log(
            f"standard deviations of {int(image.sum())} orientations and {int(point.sum())} points: "
            f"{perf_counter() - started:.2f} s"
        )
    return result


_WITHOUT_FACTOR = (
    "no standard deviations: exact covariances need the factor of the normal equations, and this block was solved by "
    "conjugate gradients, without it; `solver: direct` gives them, in {:.2g} GB of memory and {:.2g} GB on disk"
)


def _start_points(given: BundleInput, origin: Float) -> Float:
    xyz = given.xyz_m.copy()
    point, coordinate = np.nonzero(given.control.exact)
    xyz[given.control.point[point], coordinate] = given.control.xyz_m[point, coordinate]
    return np.asarray(xyz - origin)


def _free_poses(given: BundleInput, image: Bool, datum: Datum) -> Bool:
    """Which scalars of the poses are free."""
    free = np.repeat(image[:, None], 6, axis=1)
    if datum == "minimal" and image.any():
        first = int(np.argmax(image))
        away = np.where(image[:, None], np.abs(given.poses.position_m - given.poses.position_m[first]), -1.0)
        farthest, axis = np.unravel_index(int(np.argmax(away)), away.shape)
        free[first] = False
        free[farthest, axis] = False
    return free


def _free_datum(
    given: BundleInput, unknowns: list[Unknowns], records: list[Records], start: State,
    image: Bool, point: Bool, over: DatumOver,
) -> FreeDatum:  # fmt: skip
    marked = np.zeros_like(point) if given.marked is None else given.marked
    over_point = {"points": point, "images": np.zeros_like(point), "marked": point & marked}[over]
    return FreeDatum(unknowns, records, start, image, point, image & (over == "images"), over_point)


def _places(given: BundleInput, ordering: Ordering) -> Float:
    """Where the images lie, for the order of elimination: textbooks number them by strips."""
    if ordering in ("across_strips", "along_strips") and given.numbering is not None:
        return given.numbering.place
    return given.poses.position_m


def _unknowns(
    given: BundleInput, parameters: tuple[ParameterRows, ...], poses: Bool, point: Bool, places: Float
) -> list[Unknowns]:
    free = np.repeat(point[:, None], 3, axis=1)
    row, coordinate = np.nonzero(given.control.exact)
    free[given.control.point[row], coordinate] = False
    groups = [pose_unknowns(given.image_ids, poses, places)]
    for p in parameters:
        used = np.bincount(p.block, minlength=len(p.free)) > 0
        groups.append(
            Unknowns(p.group, p.free & used[:, None], p.labels, p.ids, add_step, joins=POSE if p.per_image else "")
        )
    return [*groups, Unknowns(POINT, free, ("X", "Y", "Z"), given.point_ids, add_step, eliminated=True)]


def _records(
    given: BundleInput, rays: ImagePointRows, parameters: tuple[ParameterRows, ...], origin: Float,
    image: Bool, point: Bool, huber: float | None,
) -> list[Records]:  # fmt: skip
    corrections = [LinearCorrection(p.group, p.block, p.basis) for p in parameters if p.basis is not None]
    cameras = next((CameraRows(p.block, p.model) for p in parameters if p.group == CAMERA), None)
    loss = None if huber is None else Huber(huber)
    records = [replace(image_point_records(rays, corrections, cameras), loss=loss)]
    control = given.control
    use = np.flatnonzero(point[control.point] & control.observed.any(axis=1))
    if len(use):
        xyz, covariance = control.xyz_m[use] - origin, control.covariance_m2[use]
        records.append(value_records("control", POINT, control.point[use], xyz, covariance, control.observed[use]))
    seen = np.flatnonzero(image[given.positions.image])
    if len(seen):
        p = given.positions
        position = p.position_m[seen] - origin
        records.append(position_records(p.image[seen], position, p.covariance_m2[seen], p.lever_arm_m[seen]))
    for q in parameters:
        used = np.bincount(q.block, minlength=len(q.free)) > 0
        rows = np.flatnonzero(used & (q.weighted & q.free).any(axis=1))
        if len(rows):
            weighted = (q.weighted & q.free)[rows]
            name = f"{q.group} prior"
            records.append(value_records(name, q.group, rows, q.prior[rows], q.covariance[rows], weighted))
    return records


def _result(
    given: BundleInput, adjusted: Adjusted, origin: Float, used: tuple[Bool, Bool, Bool], covariances: bool,
    free: FreeDatum | None,
) -> BundleResult:  # fmt: skip
    ray, image, point = used
    poses: Poses = adjusted.state[POSE]
    pose_cov, point_cov = np.full((len(image), 6, 6), np.nan), np.full((len(point), 3, 3), np.nan)
    parameter_cov = [np.full(p.covariance.shape, np.nan) for p in given.parameters]
    ray_covariance = np.full((len(ray), 2, 2), np.nan)
    if covariances:
        found = marginal_covariances(adjusted)
        groups = found.groups if free is None else free_covariances(free, adjusted, found.groups)
        pose_cov[image], point_cov[point] = groups[POSE][image], groups[POINT][point]
        parameter_cov = [groups[p.group] for p in given.parameters]
        ray_covariance[ray] = found.rays
    return BundleResult(
        Poses(
            np.where(image[:, None], poses.position_m + origin, np.nan),
            np.where(image[:, None, None], poses.ground_from_image, np.nan),
        ),
        np.where(point[:, None], adjusted.state[POINT] + origin, np.nan),
        pose_cov,
        point_cov,
        tuple(AdjustedParameters(p, adjusted.state[p.group], c) for p, c in zip(given.parameters, parameter_cov)),
        ray_covariance,
        ray,
        image,
        point,
        adjusted,
    )
