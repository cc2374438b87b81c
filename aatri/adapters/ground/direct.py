"""Direct georeferencing of a block: orientations from positions and attitudes, points by intersection."""

import numpy as np

from aatri.adapters import solution as assemble
from aatri.adapters.frame.adjustment_frame import InTangentFrame, frame_of, geodesy_of
from aatri.adapters.strips.oriented_strips import Placed, solution_of
from aatri.adjusting.uncertain_intersection import intersect_uncertain
from aatri.arrays import Bool, Float, finite_rows
from aatri.artifacts.block import ANTENNA, OBSERVED_VALUE, Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.residuals import Residuals
from aatri.artifacts.solution import Solution
from aatri.artifacts.suspects import Suspects
from aatri.errors import GeometryError
from aatri.frames.tangent import TangentFrame
from aatri.geometry.rotations import exp_rotation, skew
from aatri.notes import Note
from aatri.observations.attitudes import attitudes_of, boresight_sigma
from aatri.observations.image_points import rays_of
from aatri.observations.observed import ObservationSource
from aatri.observations.poses import POSE, Poses

METHOD = "absolute_orientation/direct"


def direct_solution(block: Block, image_points: ImagePoints | None) -> tuple[Solution, tuple[Note, ...]]:
    """The Solution, and what there is to say of it.

    Raises
    ------
    GeometryError
        If no image has both an observed position and observed attitudes.
    """
    frame = frame_of(block)
    poses, covariance = _poses(block, frame)
    oriented = finite_rows(poses.position_m)
    if not oriented.any():
        raise GeometryError(
            "no image has both an observed position and observed angles",
            where=f"block {block.name}",
            remedy="give X, Y, Z, a1, a2, a3 and their standard deviations in exterior.csv, use: observed",
        )
    solution = _solution(block, image_points, poses, covariance)
    return InTangentFrame(block, None, frame).back(solution), _notes(block, oriented)


def _poses(block: Block, frame: TangentFrame | None) -> tuple[Poses, Float]:
    """Orientations in the frame of the adjustment, with covariances (n, 6, 6); NaN where not given.

    X0 = X_antenna - R a and R = R_obs exp([b]x), with d = turns of the angles and of the boresight.
    """
    n, e = len(block.images), block.exterior
    position, rotation, covariance = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan), np.full((n, 6, 6), np.nan)
    source = ObservationSource(
        block,
        None,
        np.zeros(3),
        {POSE: Poses(np.full((n, 3), np.nan), rotation)},
        frame=frame,
        geodesy=geodesy_of(block, frame),
    )
    rows = attitudes_of(source)
    usable = rows.complete & (e.position_use[rows.row] == OBSERVED_VALUE) & finite_rows(e.position_m)[rows.row]
    row, image, camera = rows.row[usable], rows.image[usable], rows.camera[usable]
    antenna, D = source.placed(e.position_m[row])
    inverse = np.linalg.inv(D)
    C_antenna = inverse @ e.position_covariance_m2[row] @ inverse.swapaxes(1, 2)
    R = rows.axes[usable] @ rows.observed[usable] @ exp_rotation(block.cameras.boresight_rad[camera])
    G = rows.axes[usable] @ rows.turning[usable]
    C_turn = G @ ((rows.sigma_rad[usable] ** 2)[:, :, None] * np.eye(3)) @ G.swapaxes(1, 2)
    boresight = (boresight_sigma(block)[camera] ** 2)[:, :, None] * np.eye(3)
    C_turn = C_turn + R @ boresight @ R.swapaxes(1, 2)
    arm = np.where((e.refers_to[row] == ANTENNA)[:, None], block.cameras.lever_arm_m[camera], 0.0)
    away = np.einsum("nij,nj->ni", R, arm)
    K = skew(away)
    position[image], rotation[image] = antenna - away, R
    cross = K @ C_turn
    covariance[image] = np.block([[C_antenna + cross @ K.swapaxes(1, 2), cross], [cross.swapaxes(1, 2), C_turn]])
    return Poses(position, rotation), covariance


def _solution(block: Block, image_points: ImagePoints | None, poses: Poses, covariance: Float) -> Solution:
    residuals, counts, sigma0, sigma0_um = Residuals.empty(), (0, 0), float("nan"), float("nan")
    xyz, covariance_m2 = np.full((len(block.points), 3), np.nan), None
    if image_points is not None:
        intersection = intersect_uncertain(rays_of(block, image_points), poses, covariance, len(block.points))
        m, used = image_points.measurements, intersection.used
        xyz, covariance_m2 = intersection.xyz_m, intersection.covariance_m2
        rows = np.flatnonzero(used)
        names = block.images.id[m.image[rows]], block.points.id[m.point[rows]]
        residuals = assemble.residuals(
            "image_point", rows, *names, intersection.residual_mm[rows], intersection.sigma_mm[rows]
        )
        counts = 2 * len(rows), 3 * int((intersection.rays > 0).sum())
        if (redundancy := counts[0] - counts[1]) > 0:
            sigma0 = float(np.sqrt((intersection.whitened[used] ** 2).sum() / redundancy))
            sigma0_um = 1e3 * sigma0 * float(np.sqrt((intersection.sigma_mm[used] ** 2).mean()))
    return solution_of(
        block,
        image_points,
        Placed(poses.position_m, poses.ground_from_image, xyz),
        method=METHOD,
        counts=counts,
        sigma0=sigma0,
        sigma0_um=sigma0_um,
        iterations=1,
        residuals=residuals,
        suspects=Suspects.empty(),
        point_covariance_m2=covariance_m2,
        image_covariance=covariance,
    )


def _notes(block: Block, oriented: Bool) -> tuple[Note, ...]:
    notes = []
    lacking = block.images.active & ~oriented
    if lacking.any():
        text = f"not oriented, without observed position or angles ({int(lacking.sum())} of {len(oriented)} images)"
        notes.append(Note("warning", text, tuple(block.images.id[lacking].tolist())))
    p = block.camera_parameters
    free = p.free & np.char.startswith(np.asarray(p.name, dtype=np.str_), "boresight")
    if free.any():
        cameras = tuple(np.unique(block.cameras.id[p.camera[free]]).tolist())
        text = "boresight is free, but nothing here determines it: taken as given; calibrate it by a bundle first"
        notes.append(Note("warning", text, cameras))
    return tuple(notes)
