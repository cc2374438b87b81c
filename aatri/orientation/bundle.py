"""Bundle block adjustment: all rays of all images together.

Unknowns are the poses of the images (X0, d), the ground points, which are eliminated point by point, and where wanted
six interior unknowns per film image. Observations are image points (collinearity), control coordinates, observed
positions, and the priors of the interior unknowns. Exact control coordinates are held.

Coordinates are reduced to an origin near the block before any arithmetic. What cannot be determined is left out before
the first iteration and named: points with too few rays, images with too few points.

Source: Kraus, Photogrammetry; photogrammetry.md A901-A910.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from aatri.adjustment.covariance import marginal_covariances
from aatri.adjustment.records import Records
from aatri.adjustment.solve import Adjusted, adjust_large
from aatri.adjustment.unknowns import Ids, Unknowns, add_step
from aatri.geometry.vectors import finite_rows
from aatri.observations.coordinates import value_records
from aatri.observations.image_points import ImagePointRows, image_point_records, side_changes
from aatri.observations.poses import INTERIOR, POINT, POSE, Poses, pose_unknowns
from aatri.observations.positions import position_records
from aatri.progress import SILENT, Reporter

Float = npt.NDArray[np.float64]
Int = npt.NDArray[np.int32]
Bool = npt.NDArray[np.bool_]

MIN_IMAGE_POINTS = 3


@dataclass(frozen=True)
class ControlRows:
    """Control: point row, coordinates, covariance, and which coordinates are observed or held; see given.Control."""

    point: Int
    xyz_m: Float
    covariance_m2: Float
    observed: Bool
    held: Bool


@dataclass(frozen=True)
class PositionRows:
    """Observed positions; see observations.positions."""

    image: Int
    position_m: Float
    covariance_m2: Float
    lever_arm_m: Float


@dataclass(frozen=True)
class BundleInput:
    """A block ready for adjustment: rows are those of all images and points.

    Attributes
    ----------
    image_ids, point_ids : str
    rays : ImagePointRows
    poses : Poses
        Start; NaN where unknown.
    xyz_m : (n_points, 3) float64, m
        Start; NaN where unknown.
    control : ControlRows
    positions : PositionRows
    interior_covariance : (n_images, 6, 6) float64 or None
        Priors of the interior unknowns; an image with a zero matrix has none.
    """

    image_ids: Ids
    point_ids: Ids
    rays: ImagePointRows
    poses: Poses
    xyz_m: Float
    control: ControlRows
    positions: PositionRows
    interior_covariance: Float | None


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
    interior : (n_images, 6) float64 or None
    interior_covariance : (n_images, 6, 6) float64 or None
    ray_used : (n,) bool
    image_adjusted, point_adjusted : bool
    adjusted : Adjusted
    """

    poses: Poses
    xyz_m: Float
    pose_covariance: Float
    point_covariance_m2: Float
    interior: Float | None
    interior_covariance: Float | None
    ray_used: Bool
    image_adjusted: Bool
    point_adjusted: Bool
    adjusted: Adjusted


def determinable(given: BundleInput) -> tuple[Bool, Bool, Bool]:
    """Which rays, images and points can take part: start values known, enough rays each, repeated until stable.

    Returns
    -------
    ray, image, point : bool arrays
    """
    rays, n_images, n_points = given.rays, len(given.image_ids), len(given.point_ids)
    image = finite_rows(given.poses.position_m) & finite_rows(given.poses.ground_from_image)
    point = finite_rows(given.xyz_m)
    control = np.zeros(n_points, dtype=np.int64)
    np.add.at(control, given.control.point, (given.control.observed | given.control.held).sum(axis=1))
    positioned = np.bincount(given.positions.image, minlength=n_images) > 0
    while True:
        ray = rays.active & image[rays.image] & point[rays.point]
        per_point = np.bincount(rays.point[ray], minlength=n_points)
        per_image = np.bincount(rays.image[ray], minlength=n_images)
        enough_points = (per_image >= MIN_IMAGE_POINTS) | (positioned & (per_image >= MIN_IMAGE_POINTS - 1))
        enough_rays = (per_point >= 2) | ((per_point >= 1) & (control > 0))
        if not (image & ~enough_points).any() and not (point & ~enough_rays).any():
            return ray, image, point
        image, point = image & enough_points, point & enough_rays


def adjust_bundle(
    given: BundleInput,
    *,
    max_iterations: int = 30,
    covariances: bool = True,
    reporter: Reporter = SILENT,
) -> BundleResult:
    """Adjust a block.

    Raises
    ------
    GeometryError
        If unknowns are not determined; the message names them.
    ConvergenceError
        If the iteration does not converge.
    """
    ray, image, point = determinable(given)
    origin = np.round(given.xyz_m[point].mean(axis=0)) if point.any() else np.zeros(3)
    rays = _chosen(given.rays, ray)
    start = {
        POSE: Poses(given.poses.position_m - origin, given.poses.ground_from_image),
        POINT: _start_points(given, origin),
        INTERIOR: np.zeros((len(given.image_ids), 6)),
    }
    unknowns = _unknowns(given, image, point)
    records = _records(given, rays, origin, image, point)
    adjusted = adjust_large(
        unknowns,
        records,
        start,
        max_iterations=max_iterations,
        veto=lambda old, new: side_changes(rays, old, new),
        reporter=reporter,
    )
    return _result(given, adjusted, origin, (ray, image, point), covariances)


def _chosen(rays: ImagePointRows, use: Bool) -> ImagePointRows:
    return ImagePointRows(rays.image[use], rays.point[use], rays.xy_mm[use], rays.sigma_mm[use], rays.c_mm[use],
                          rays.principal_point_mm[use], rays.active[use])  # fmt: skip


def _start_points(given: BundleInput, origin: Float) -> Float:
    xyz = given.xyz_m.copy()
    point, coordinate = np.nonzero(given.control.held)
    xyz[given.control.point[point], coordinate] = given.control.xyz_m[point, coordinate]
    return np.asarray(xyz - origin)


def _unknowns(given: BundleInput, image: Bool, point: Bool) -> list[Unknowns]:
    free = np.repeat(point[:, None], 3, axis=1)
    row, coordinate = np.nonzero(given.control.held)
    free[given.control.point[row], coordinate] = False
    groups = [pose_unknowns(given.image_ids, np.repeat(image[:, None], 6, axis=1), given.poses.position_m)]
    if given.interior_covariance is not None:
        latent = image & (np.einsum("nii->ni", given.interior_covariance) > 0).all(axis=1)
        labels = tuple(f"interior d{k}" for k in range(6))
        six = np.repeat(latent[:, None], 6, axis=1)
        groups.append(Unknowns(INTERIOR, six, labels, given.image_ids, add_step, joins=POSE))
    return [*groups, Unknowns(POINT, free, ("X", "Y", "Z"), given.point_ids, add_step, eliminated=True)]


def _records(given: BundleInput, rays: ImagePointRows, origin: Float, image: Bool, point: Bool) -> list[Records]:
    records = [image_point_records(rays, interior=given.interior_covariance is not None)]
    control = given.control
    use = np.flatnonzero(point[control.point] & control.observed.any(axis=1))
    if len(use):
        xyz = control.xyz_m[use] - origin
        covariance = control.covariance_m2[use]
        records.append(value_records("control", POINT, control.point[use], xyz, covariance, control.observed[use]))
    seen = np.flatnonzero(image[given.positions.image])
    if len(seen):
        p = given.positions
        position = p.position_m[seen] - origin
        records.append(position_records(p.image[seen], position, p.covariance_m2[seen], p.lever_arm_m[seen]))
    if given.interior_covariance is not None:
        latent = image & (np.einsum("nii->ni", given.interior_covariance) > 0).all(axis=1)
        rows = np.flatnonzero(latent).astype(np.int32)
        prior = given.interior_covariance[rows]
        records.append(value_records("interior prior", INTERIOR, rows, np.zeros((len(rows), 6)), prior))
    return records


def _result(
    given: BundleInput,
    adjusted: Adjusted,
    origin: Float,
    used: tuple[Bool, Bool, Bool],
    covariances: bool,
) -> BundleResult:
    ray, image, point = used
    poses: Poses = adjusted.state[POSE]
    n_images, n_points = len(image), len(point)
    pose_cov, point_cov = np.full((n_images, 6, 6), np.nan), np.full((n_points, 3, 3), np.nan)
    interior = interior_cov = None
    if given.interior_covariance is not None:
        interior, interior_cov = adjusted.state[INTERIOR], np.full((n_images, 6, 6), np.nan)
    if covariances:
        found = marginal_covariances(adjusted).groups
        pose_cov[image], point_cov[point] = found[POSE][image], found[POINT][point]
        if interior_cov is not None:
            interior_cov[image] = found[INTERIOR][image]
    return BundleResult(
        Poses(
            np.where(image[:, None], poses.position_m + origin, np.nan),
            np.where(image[:, None, None], poses.ground_from_image, np.nan),
        ),
        np.where(point[:, None], adjusted.state[POINT] + origin, np.nan),
        pose_cov, point_cov, interior, interior_cov, ray, image, point, adjusted,
    )  # fmt: skip
