"""Bundle adjustment from bad starts: where it fails, once more from a start that collinearity in object space gives.

The direct adjustment is tried first. If it does not converge, needs damping and ends with a sigma0 far above 1, or
turns images over (most of their points behind them), poses and points are adjusted to the conditions of
`observations.object_space`, together with control and observed positions: with rotations held, where it is linear, then
all; image points down-weighted, then as they are. Images that come out turned over are mirrored on the plane of their
points. From there the adjustment is tried again, and the best result counts. A result with images turned over is none:
over flat ground their residuals are as small as the right ones.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.adjustment.records import Records
from aatri.adjustment.solve import adjust_large
from aatri.adjustment.unknowns import Unknowns, add_step
from aatri.errors import ConvergenceError, GeometryError
from aatri.geometry.vectors import finite_rows
from aatri.ids import shown
from aatri.observations.coordinates import value_records
from aatri.observations.object_space import object_space_records
from aatri.observations.poses import POINT, POSE, Poses, pose_unknowns
from aatri.observations.positions import position_records
from aatri.orientation.bundle import BundleResult, adjust_bundle
from aatri.orientation.bundle_input import BundleInput, determinable
from aatri.progress import SILENT, Reporter

Float = npt.NDArray[np.float64]
Int = npt.NDArray[np.integer]
Bool = npt.NDArray[np.bool_]

FAR_SIGMA0 = 3.0
"""sigma0 above which an adjustment that had to be damped is tried from elsewhere."""

TRIALS = ((1e3, True), (1e3, False), (1.0, True), (1.0, False))
"""Factor on the standard deviations of the image points in object space; whether rotations are held at first."""

SPACE_ITERATIONS = 60
SPACE_TOLERANCE = 0.1


def adjust_bundle_from_afar(given: BundleInput, *, reporter: Reporter = SILENT, **options: Any) -> BundleResult:
    """Adjust a block whose start may be far off.

    Parameters
    ----------
    given : BundleInput
    reporter : Reporter
    **options
        Of `adjust_bundle`. Blocks without a given datum are adjusted from their start alone.

    Raises
    ------
    GeometryError
        If unknowns are not determined.
    ConvergenceError
        If no start converges, or images end up turned over.
    """
    failure: ConvergenceError | GeometryError | None = None
    best: BundleResult | None = None
    try:
        best = adjust_bundle(given, reporter=reporter, **options)
    except (ConvergenceError, GeometryError) as error:
        failure = error
    if options.get("datum", "given") == "given" and not _trusted(given, best):
        why = failure.what if failure is not None else "another minimum is likely"
        reporter.log(f"adjusted again from a start by object space: {why}")
        best = _best_restart(given, best, reporter, options)
    if best is None:
        assert failure is not None
        raise failure
    over = turned_over(given, best.poses, best.xyz_m, best.ray_used)
    if over.any():
        raise ConvergenceError(
            f"images see most of their points behind them: {shown(np.asarray(given.image_ids)[over])}",
            remedy="start from better initial values (`from: initial`); check the sign of c and the axes of the image",
        )
    return best


def turned_over(given: BundleInput, poses: Poses, xyz_m: Float, ray: Bool) -> Bool:
    """Images with more than half of their points behind them.

    Parameters
    ----------
    ray : (n,) bool
        Rays to look at.

    Returns
    -------
    (n_images,) bool
    """
    image, point = given.rays.image[ray], given.rays.point[ray]
    axis = poses.ground_from_image[image][:, :, 2]
    behind = np.einsum("ni,ni->n", axis, xyz_m[point] - poses.position_m[image]) > 0
    n = len(given.image_ids)
    return np.asarray(2 * np.bincount(image[behind], minlength=n) > np.bincount(image, minlength=n))


def _trusted(given: BundleInput, result: BundleResult | None, restarted: bool = False) -> bool:
    if result is None or turned_over(given, result.poses, result.xyz_m, result.ray_used).any():
        return False
    strayed = restarted or any(step.damping > 0 for step in result.adjusted.history)
    return not (strayed and result.adjusted.sigma0 > FAR_SIGMA0)


def _best_restart(
    given: BundleInput, best: BundleResult | None, reporter: Reporter, options: dict[str, Any]
) -> BundleResult | None:
    """The best of the results so far and those of new starts; one without images turned over comes first."""
    for factor, held in TRIALS:
        try:
            started = _start_in_space(given, factor, held)
            found = adjust_bundle(started, reporter=reporter, **options)
        except (ConvergenceError, GeometryError) as error:
            reporter.log(f"start by object space, sigmas of the image points times {factor:g}: {error.what}")
            continue
        if best is None or _rank(given, found) < _rank(given, best):
            best = found
        if _trusted(given, best, restarted=True):
            break
    return best


def _rank(given: BundleInput, result: BundleResult) -> tuple[int, float]:
    over = turned_over(given, result.poses, result.xyz_m, result.ray_used)
    return int(over.sum()), result.adjusted.cost


def _start_in_space(given: BundleInput, factor: float, rotations_held: bool) -> BundleInput:
    """The block with poses and points adjusted in object space; cameras at their start, film as measured."""
    ray, image, point = determinable(given)
    rays = given.rays.take(ray)
    origin = np.round(given.xyz_m[point].mean(axis=0))
    control = given.control
    exact, coordinate = np.nonzero(control.held)
    xyz = given.xyz_m.copy()
    xyz[control.point[exact], coordinate] = control.xyz_m[exact, coordinate]
    free = np.repeat(point[:, None], 3, axis=1)
    free[control.point[exact], coordinate] = False
    distance = float(np.median(np.linalg.norm(xyz[rays.point] - given.poses.position_m[rays.image], axis=1)))
    records = [object_space_records(rays, distance, factor), *_given_records(given, origin, image, point)]
    state: Any = {POSE: Poses(given.poses.position_m - origin, given.poses.ground_from_image), POINT: xyz - origin}
    for turning in (False, True) if rotations_held else (True,):
        pose = np.repeat(image[:, None], 6, axis=1)
        pose[:, 3:] &= turning
        unknowns = [pose_unknowns(given.image_ids, pose, given.poses.position_m),
                    Unknowns(POINT, free, ("X", "Y", "Z"), given.point_ids, add_step, eliminated=True)]  # fmt: skip
        found = adjust_large(unknowns, records, state, max_iterations=SPACE_ITERATIONS, tolerance=SPACE_TOLERANCE)
        state = found.state
    poses, xyz = found.state[POSE], found.state[POINT] + origin
    poses = Poses(poses.position_m + origin, poses.ground_from_image)
    for k in np.flatnonzero(turned_over(given, poses, xyz, ray)):
        poses = _mirrored(poses, int(k), xyz[given.rays.point[ray & (given.rays.image == k)]])
    return replace(given, poses=poses, xyz_m=np.where(point[:, None], xyz, given.xyz_m))


def _given_records(given: BundleInput, origin: Float, image: Bool, point: Bool) -> list[Records]:
    """Control and observed positions."""
    control, p, records = given.control, given.positions, []
    use = np.flatnonzero(point[control.point] & control.observed.any(axis=1))
    if len(use):
        records.append(value_records("control", POINT, control.point[use], control.xyz_m[use] - origin,
                                     control.covariance_m2[use], control.observed[use]))  # fmt: skip
    seen = np.flatnonzero(image[p.image])
    if len(seen):
        records.append(position_records(p.image[seen], p.position_m[seen] - origin, p.covariance_m2[seen],
                                        p.lever_arm_m[seen]))  # fmt: skip
    return records


def _mirrored(poses: Poses, k: int, xyz_m: Float) -> Poses:
    """An image turned over, mirrored on the plane of its points: there u becomes -u, and x, y stay what they are."""
    centre = xyz_m[finite_rows(xyz_m)].mean(axis=0)
    normal = np.linalg.svd(xyz_m[finite_rows(xyz_m)] - centre)[2][2]
    mirror = np.eye(3) - 2.0 * np.outer(normal, normal)
    position, rotation = poses.position_m.copy(), poses.ground_from_image.copy()
    position[k] = centre + mirror @ (position[k] - centre)
    rotation[k] = -mirror @ rotation[k]
    return Poses(position, rotation)
