"""Both programs on one array block: each from its own data structures, built before the clock starts.

Every function returns a `Run`; what is timed is named there. A pixel of COLMAP's image points is one standard
deviation, so that its unit-weight reprojection error is the whitened residual and both costs are the same function.
"""

from __future__ import annotations

import resource
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from aatri.adjustment.covariance.marginal import marginal_covariances
from aatri.adjustment.elimination.fronts import factorise
from aatri.adjustment.structure.indexed_problem import IndexedProblem
from aatri.arrays import Float, Int, Text
from aatri.observations.image_points import ImagePointRows, observed_image_points
from aatri.observations.poses import Poses
from aatri.observations.positions import Positions, observed_positions
from aatri.orientation.bundle.adjust import adjust_bundle
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.settings import BundleSettings
from benchmarks.blocks import ArrayBlock
from benchmarks.common_gradient import cost_and_gradient


@dataclass(frozen=True)
class Run:
    """One measured adjustment.

    Attributes
    ----------
    wall_s, cpu_s : float
        From the program's input to its solution, index building included; processor time of all threads.
    iterations : int
    cost, gradient : float
        Of the solution, by `cost_and_gradient`.
    memory_gb : float
        Peak of the process, input and Python included.
    covariance_wall_s, covariance_cpu_s : float
        Covariances of all poses; 0 if not asked for.
    more : dict
        What only one program has.
    """

    wall_s: float
    cpu_s: float
    iterations: int
    cost: float
    gradient: float
    memory_gb: float
    covariance_wall_s: float
    covariance_cpu_s: float
    more: dict[str, Any]


def run_aatri(block: ArrayBlock, *, covariances: bool) -> Run:
    """Adjust with aatri; in `more` the flops and the time of the tree's factorisation and of all covariances."""
    given = _bundle_input(block)
    result, wall, cpu = _timed(lambda: adjust_bundle(given, BundleSettings(covariances=False)))
    memory = _peak_gb()
    cost, gradient = cost_and_gradient(block, result.poses.position_m, result.poses.ground_from_image, result.xyz_m)
    problem = result.adjusted.problem
    factorised, factor_wall, factor_cpu = _timed(lambda: factorise(_tree_alone(problem), result.adjusted.state))
    del factorised
    more = {
        "flops": problem.tree.flops,
        "factor_wall_s": factor_wall,
        "factor_cpu_s": factor_cpu,
        "factor_mb": problem.tree.factor_bytes / 1e6,
        "dgemm_flops": dgemm_rate(problem.threads),
    }
    poses_wall = poses_cpu = 0.0
    if covariances:
        _, poses_wall, poses_cpu = _timed(lambda: marginal_covariances(result.adjusted, blocks=False))
        _, more["all_covariances_wall_s"], more["all_covariances_cpu_s"] = _timed(
            lambda: marginal_covariances(result.adjusted)
        )
    return Run(wall, cpu, len(result.adjusted.history), cost, gradient, memory, poses_wall, poses_cpu, more)


def run_colmap(block: ArrayBlock, *, tuned: bool, gradient_tolerance: float, covariances: bool) -> Run:
    """Adjust with pycolmap: pose-prior bundle adjustment, interior orientation constant.

    Parameters
    ----------
    tuned : bool
        Trust region of 1e12 from the start, SPARSE_SCHUR, two threads; else COLMAP's own choices.
    gradient_tolerance : float
        Where to stop.
    """
    import pycolmap

    reconstruction, priors, origin = _reconstruction(block)
    config = pycolmap.BundleAdjustmentConfig()
    for i in range(len(block.position_m)):
        config.add_image(i + 1)
    config.set_constant_cam_intrinsics(1)
    options = pycolmap.BundleAdjustmentOptions(
        refine_focal_length=False, refine_extra_params=False, print_summary=False
    )
    solver = options.ceres.solver_options
    solver.gradient_tolerance = gradient_tolerance
    if tuned:
        options.ceres.auto_select_solver_type = False
        solver.linear_solver_type = type(solver.linear_solver_type).SPARSE_SCHUR
        solver.initial_trust_region_radius, solver.num_threads = 1e12, 2
    prior_options = pycolmap.PosePriorBundleAdjustmentOptions()
    kept: list[Any] = []

    def solve() -> Any:
        kept.append(
            pycolmap.create_pose_prior_ceres_bundle_adjuster(options, prior_options, config, priors, reconstruction)
        )
        return kept[0].solve()

    summary, wall, cpu = _timed(solve)
    memory = _peak_gb()
    solver_summary = summary.ceres_summary
    iterations = solver_summary.num_successful_steps + solver_summary.num_unsuccessful_steps
    cost, gradient = cost_and_gradient(block, *_solution(reconstruction, block, origin))
    cov_wall = cov_cpu = 0.0
    if covariances:
        wanted = pycolmap.BACovarianceOptions(params=pycolmap.BACovarianceOptionsParams.POSES)
        found, cov_wall, cov_cpu = _timed(lambda: pycolmap.estimate_ba_covariance(wanted, reconstruction, kept[0]))
        if found is None:
            cov_wall = cov_cpu = float("nan")
    termination = str(solver_summary.termination_type).rsplit(".", maxsplit=1)[-1]
    more = {
        "termination": termination,
        "solver": str(solver_summary.linear_solver_type_used).rsplit(".", maxsplit=1)[-1],
    }
    return Run(wall, cpu, iterations, cost, gradient, memory, cov_wall, cov_cpu, more)


def dgemm_rate(threads: int, n: int = 2000) -> float:
    """Flops per second of a product of two matrices of this size, best of three."""
    a = np.random.default_rng(0).normal(size=(n, n))
    with threadpool_limits(threads, user_api="blas"):
        return 2.0 * n**3 / min(_timed(lambda: a @ a)[1] for _ in range(3))


def _timed(work: Callable[[], Any]) -> tuple[Any, float, float]:
    """Result, wall and processor time."""
    wall, cpu = time.perf_counter(), time.process_time()
    result = work()
    return result, time.perf_counter() - wall, time.process_time() - cpu


def _peak_gb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9


def _tree_alone(problem: IndexedProblem) -> IndexedProblem:
    """The same fronts without observations and with a unit diagonal: what the factorisation alone takes."""
    layout = replace(problem.layout, fixed=np.ones_like(problem.layout.fixed))
    return replace(problem, rays=None, kept=(), direct=(), layout=layout)


def _bundle_input(block: ArrayBlock) -> BundleInput:
    n, m = len(block.position_m), len(block.image)
    rays = ImagePointRows(
        block.image,
        block.point,
        block.xy_mm,
        np.full((m, 2), block.sigma_mm),
        np.full(m, block.c_mm),
        np.zeros((m, 2)),
        np.ones(m, dtype=bool),
    )
    covariance = np.tile(block.gnss_sigma_m**2 * np.eye(3), (n, 1, 1))
    images = np.arange(n, dtype=np.int32)
    positions = Positions(images, images, block.gnss_m, covariance, np.zeros((n, 3)))
    ids, point_ids = np.arange(n).astype(str), np.arange(len(block.xyz_m)).astype(str)
    origin = np.round(block.xyz_m.mean(axis=0))

    def names(rows: Int) -> tuple[Text, Text]:
        return ids[rays.image[rows]], point_ids[rays.point[rows]]

    observed = (*observed_image_points(rays, (), names), *observed_positions(positions, origin, ids))
    start = Poses(block.position_m - origin, block.ground_from_image)
    return BundleInput(ids, point_ids, observed, start, block.xyz_m - origin, origin, rays)


def _reconstruction(block: ArrayBlock) -> tuple[Any, list[Any], Float]:
    """The block as COLMAP sees it, and its position priors; coordinates from the returned origin."""
    import pycolmap

    found, origin, n = pycolmap.Reconstruction(), block.position_m.mean(axis=0), len(block.position_m)
    scale, side = 1 / block.sigma_mm, 4 * float(np.abs(block.xy_mm).max()) / block.sigma_mm
    c = block.c_mm * scale
    found.add_camera_with_trivial_rig(
        pycolmap.Camera(camera_id=1, model="PINHOLE", width=int(side), height=int(side), params=[c, c, 0.0, 0.0])
    )
    order = np.argsort(block.image, kind="stable")
    start = np.searchsorted(block.image[order], np.arange(n + 1))
    number = np.empty(len(order), dtype=np.int64)
    priors = []
    for i in range(n):
        rows = order[start[i] : start[i + 1]]
        number[rows] = np.arange(len(rows))
        R = np.diag([1.0, -1.0, -1.0]) @ block.ground_from_image[i].T
        points = pycolmap.Point2DList([pycolmap.Point2D(xy) for xy in block.xy_mm[rows] * [scale, -scale]])
        pose = pycolmap.Rigid3d(pycolmap.Rotation3d(R), -R @ (block.position_m[i] - origin))
        image = pycolmap.Image(image_id=i + 1, camera_id=1, name=str(i), points2D=points)
        found.add_image_with_trivial_frame(image, pose)
        priors.append(
            pycolmap.PosePrior(
                pose_prior_id=i + 1,
                corr_data_id=found.image(i + 1).data_id,
                position=block.gnss_m[i] - origin,
                position_covariance=block.gnss_sigma_m**2 * np.eye(3),
                coordinate_system=pycolmap.PosePriorCoordinateSystem.CARTESIAN,
            )
        )
    by_point = np.argsort(block.point, kind="stable")
    start = np.searchsorted(block.point[by_point], np.arange(len(block.xyz_m) + 1))
    for p, X in enumerate(block.xyz_m):
        rows = by_point[start[p] : start[p + 1]]
        track = [pycolmap.TrackElement(int(block.image[k]) + 1, int(number[k])) for k in rows]
        found.add_point3D(X - origin, pycolmap.Track(track))
    return found, priors, origin


def _solution(reconstruction: Any, block: ArrayBlock, origin: Float) -> tuple[Float, Float, Float]:
    poses = [reconstruction.image(i + 1) for i in range(len(block.position_m))]
    X0 = np.array([image.projection_center() for image in poses]) + origin
    camera_from_ground = np.array([image.cam_from_world().rotation.matrix() for image in poses])
    R = camera_from_ground.swapaxes(1, 2) @ np.diag([1.0, -1.0, -1.0])
    X = np.array([reconstruction.point3D(p + 1).xyz for p in range(len(block.xyz_m))]) + origin
    return X0, R, X
