"""From an adjusted bundle to a Solution."""

from dataclasses import replace

import numpy as np

from aatri.adapters import solution as assemble
from aatri.adapters.bundle.bundle_tables import independent_errors_table
from aatri.adapters.bundle.information_observed import InformationShare
from aatri.adapters.cameras.tables import ParameterTables
from aatri.adapters.cameras.unknowns import PRINCIPAL_POINT
from aatri.adapters.frame.adjustment_frame import result_out_of
from aatri.adapters.observation_tables import reliability_table, residual_table
from aatri.arrays import Float, Int, Text
from aatri.artifacts.block import Block
from aatri.artifacts.residuals import Residuals, Tests
from aatri.artifacts.solution import (
    DatumCarriers,
    Iterations,
    Parameters,
    Solution,
    SolvedCameras,
    StripTransformations,
)
from aatri.artifacts.suspects import Suspects, Uncontrolled
from aatri.camera.parameters.brown import interior_orientation
from aatri.camera.parameters.catalogue import INTERIOR, is_ideal
from aatri.observations.observed import ObservationSource
from aatri.observations.poses import ADDITIONAL, CAMERA, FILM_PRIOR
from aatri.orientation.bundle.block import BundleInput
from aatri.orientation.bundle.result import BundleResult, gains_of_observations, without_absent
from aatri.orientation.bundle.rounds import AdjustedBlock

NOTHING_OF_CAMERAS = ParameterTables()


def bundle_solution(
    source: ObservationSource,
    done: AdjustedBlock,
    suspects: Suspects,
    uncontrolled: Uncontrolled | None,
    of_cameras: ParameterTables = NOTHING_OF_CAMERAS,
    *,
    variant: str = "bundle",
    tests: bool = False,
) -> Solution:
    """Orientations, points, cameras, parameters, residuals and history of an adjusted block.

    Parameters
    ----------
    uncontrolled : Uncontrolled or None
        Corrections of the film among them are not listed.
    variant : str
        Of the role.
    tests : bool
        Redundancy numbers, tests and detectable errors of all observations.
    """
    stated, result = done.inputs, done.result
    adjusted, block = result.adjusted, source.block
    independent = independent_errors_table(block, result, tests=tests)
    result = without_absent(result_out_of(source.frame, result))
    per_image, per_point, rms_sigma_um = _image_points(stated, result)
    state = adjusted.state
    return Solution(
        method=f"bundle_adjustment/{variant}",
        observations=adjusted.observations,
        unknowns=adjusted.n_unknowns,
        redundancy=adjusted.redundancy,
        sigma0=adjusted.sigma0 * done.scale,
        sigma0_um=adjusted.sigma0 * done.scale * rms_sigma_um,
        sigma_scale=done.scale,
        iterations=len(adjusted.history),
        images=assemble.oriented_images(
            block, result.poses.position_m, result.poses.ground_from_image, per_image, result.pose_covariance
        ),
        points=assemble.ground_points(block, result.xyz_m, per_point, result.point_covariance_m2),
        cameras=_cameras(block, of_cameras),
        transformations=StripTransformations.empty(),
        parameters=assemble.stacked([Parameters.empty(), *of_cameras.parameters, *_own_unknowns(stated, result)]),
        residuals=assemble.stacked([Residuals.empty(), *(residual_table(o, state) for o in result.observations)]),
        history=Iterations(
            cost=np.array([s.cost for s in adjusted.history]),
            decrement=np.array([s.decrement for s in adjusted.history]),
            damping=np.array([s.damping for s in adjusted.history]),
        ),
        suspects=suspects,
        tests=_tests(result) if tests else None,
        calibrated_sets=of_cameras.sets,
        parameter_covariances=of_cameras.covariances,
        error_fields=of_cameras.fields,
        independent_errors=independent,
        uncontrolled=None if uncontrolled is None else uncontrolled.take(uncontrolled.kind != FILM_PRIOR),
        sigma0_redundancy=float("nan") if result.counted is None else result.counted,
    )


def with_share(solution: Solution, share: InformationShare) -> Solution:
    """The Solution with the observations, unknowns and residuals that stand in another block's Information."""
    more = share.observations - share.unknowns
    own = solution.redundancy if np.isnan(solution.sigma0_redundancy) else solution.sigma0_redundancy
    cost = (solution.sigma0 / solution.sigma_scale) ** 2 * own + share.cost
    sigma0 = float(np.sqrt(max(cost, 0.0) / (own + more))) * solution.sigma_scale if own + more > 0 else float("nan")
    return replace(
        solution,
        observations=solution.observations + share.observations,
        unknowns=solution.unknowns + share.unknowns,
        redundancy=solution.redundancy + more,
        sigma0=sigma0,
        sigma0_redundancy=solution.sigma0_redundancy + more,
        sigma0_um=solution.sigma0_um * sigma0 / solution.sigma0,
    )


def _tests(result: BundleResult) -> Tests:
    gains = gains_of_observations(result)
    tables = (reliability_table(o, result.adjusted.state, g) for o, g in zip(result.observations, gains))
    return assemble.stacked([Tests.empty(), *tables])


def with_datum(block: Block, solution: Solution, datum: str, over: str) -> Solution:
    """The solution with its points or images that carry a free datum; held scalars where it is minimal.

    Parameters
    ----------
    datum, over : str
        `given`, `minimal` or `free`; over `points`, `images` or `marked` points.
    """
    if datum == "given":
        return solution
    kind, ids = "point", solution.points.id[np.isfinite(solution.points.xyz_m).all(axis=1)]
    if datum == "minimal":
        kind, ids = "held", np.array([""])
    elif over == "images":
        kind, ids = "image", solution.images.id[solution.images.oriented]
    elif over == "marked":
        ground = block.ground_points
        ids = ids[np.isin(ids, block.points.id[ground.point[ground.datum]])]
    return replace(solution, datum=DatumCarriers(kind=np.full(len(ids), kind), id=ids))


def _cameras(block: Block, tables: ParameterTables) -> SolvedCameras:
    """Interior orientations as adjusted: of camera models, changed by c, x0, y0 of sets of single cameras."""
    sets = [] if tables.sets is None else tables.sets.set.tolist()
    ideal = any(is_ideal(name) for name in sets)
    cameras, p = assemble.solved_cameras(block), assemble.stacked([Parameters.empty(), *tables.parameters])
    interior = np.column_stack([cameras.principal_distance_mm, cameras.principal_point_mm])
    interior = _by_camera(cameras.id, p, CAMERA, ("principal_distance", *PRINCIPAL_POINT), interior)
    by_set = _by_camera(cameras.id, p, ADDITIONAL, INTERIOR.parameters, np.zeros_like(interior))
    values = interior + by_set
    for k, c0 in enumerate(interior[:, 0] if not ideal else ()):
        values[k] = interior_orientation(c0, by_set[k])[0] + [0.0, *interior[k, 1:]]
    return replace(cameras, principal_distance_mm=values[:, 0], principal_point_mm=values[:, 1:])


def _by_camera(cameras: Text, p: Parameters, group: str, names: tuple[str, ...], values: Float) -> Float:
    """The values (n_cameras, k) with those that the parameters have of single cameras."""
    changed = values.copy()
    row = {str(name): k for k, name in enumerate(cameras)}
    for column, name in enumerate(names):
        rows = np.flatnonzero((p.group == group) & (p.name == name))
        at = [row.get(str(camera), -1) for camera in p.object[rows]]
        if len(at) and min(at) >= 0:
            changed[at, column] = p.value[rows]
    return changed


def _image_points(inputs: BundleInput, result: BundleResult) -> tuple[Int, Int, float]:
    """Image points used per image and point, and their standard deviation, RMS, um."""
    n_images, n_points = len(inputs.image_ids), len(inputs.point_ids)
    if inputs.rays is None or not result.ray_used.any():
        return np.zeros(n_images, dtype=np.int64), np.zeros(n_points, dtype=np.int64), float("nan")
    used = result.ray_used
    return (
        np.bincount(inputs.rays.image[used], minlength=n_images),
        np.bincount(inputs.rays.point[used], minlength=n_points),
        1e3 * float(np.sqrt((inputs.rays.sigma_mm[used] ** 2).mean())),
    )


def _own_unknowns(inputs: BundleInput, result: BundleResult) -> list[Parameters]:
    """Unknowns that kinds of observations bring along: drift ..."""
    of_cameras_already = {p.group for p in inputs.parameters}
    tables = []
    for o in inputs.observed:
        for u in o.unknowns:
            if u.name in of_cameras_already:
                continue
            free = next(w.free for w in result.adjusted.problem.unknowns if w.name == u.name)
            row, scalar = np.nonzero(free)
            variance = np.einsum("nii->ni", result.covariances[u.name])[row, scalar]
            tables.append(
                Parameters(
                    group=np.full(len(row), u.name),
                    object=np.asarray(u.ids, dtype=np.str_)[row],
                    name=np.array(u.labels, dtype=np.str_)[scalar],
                    value=result.adjusted.state[u.name][row, scalar],
                    sigma=np.sqrt(variance),
                )
            )
    return tables
