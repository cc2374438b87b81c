"""A block with all that is given of the ground in its tangent frame, for methods that find approximate orientations.

Such a method takes the block as it is here, knows nothing of maps, and its Solution is brought back. Whole positions
are converted exactly, with their covariances. Control or a position in plan or in height only has no place of its own:
what it lacks is taken from a solution that has it, and from the mean of the block before there is one. The error is
that of the lacking coordinate times the distance from the origin over the radius of the earth; the bundle, which takes
such coordinates as they are given, has none.
"""

from dataclasses import dataclass, replace

import numpy as np

from aatri.adapters.frame.adjustment_frame import frame_of, poses_into, poses_out_of
from aatri.arrays import Float, Text, finite_rows
from aatri.artifacts.block import Block, Exterior, GroundPoints
from aatri.artifacts.solution import Solution
from aatri.frames.tangent import TangentFrame
from aatri.geometry.rotations import angles_from_rotation, rotation_from_angles
from aatri.observations.poses import Poses


@dataclass(frozen=True)
class InTangentFrame:
    """A block, and a solution of it, in the frame of the adjustment; as given where that is the block's own."""

    block: Block
    initial: Solution | None
    frame: TangentFrame | None

    def back(self, solution: Solution) -> Solution:
        """A Solution made of it, in the frame of the block."""
        return solution if self.frame is None else _solution(self.frame, solution, into=False)


def in_tangent_frame(block: Block, initial: Solution | None = None) -> InTangentFrame:
    """The block and a solution in the frame of the adjustment.

    Raises
    ------
    InputError
        If the block asks for a tangent frame that its CRS does not allow.
    """
    frame = frame_of(block)
    if frame is None:
        return InTangentFrame(block, initial, None)
    moved = replace(
        block,
        earth_curvature="ignore",
        frames=replace(block.frames, crs=_tangent_crs(block.frames.crs)),
        ground_points=_ground(block, frame, initial),
        exterior=_exterior(block, frame, initial),
    )
    return InTangentFrame(moved, _solution(frame, initial, into=True) if initial else None, frame)


def _tangent_crs(crs: Text) -> Text:
    return np.array(["local", *crs[1:]], dtype=np.str_)


def _ground(block: Block, frame: TangentFrame, near: Solution | None) -> GroundPoints:
    ground = block.ground_points
    guess = np.full(ground.xyz_m.shape, np.nan) if near is None else near.points.xyz_m[ground.point]
    xyz, covariance = _placed(frame, ground.xyz_m, ground.covariance_m2, guess)
    return replace(ground, xyz_m=xyz, covariance_m2=covariance)


def _placed(frame: TangentFrame, observed_m: Float, covariance_m2: Float, guess_m: Float) -> tuple[Float, Float]:
    """Coordinates and covariances in the tangent frame; what a place lacks is its guess, or the mean of the others."""
    missing = ~np.isfinite(observed_m)
    count = (~missing).sum(axis=0)
    mean = np.where(missing, 0.0, observed_m).sum(axis=0) / np.maximum(count, 1)
    placed = frame.from_block(np.where(missing, np.where(np.isfinite(guess_m), guess_m, mean), observed_m))
    complete = ~missing.any(axis=1)
    inverse = np.linalg.inv(frame.derivatives_at(placed[complete]))
    covariance = covariance_m2.copy()
    covariance[complete] = inverse @ covariance[complete] @ inverse.swapaxes(1, 2)
    return np.where(missing, np.nan, placed), _exact_kept(covariance_m2, covariance)


def _exact_kept(before: Float, after: Float) -> Float:
    """Exact coordinates stay exact."""
    exact = np.einsum("nii->ni", before) == 0
    return np.where(exact[:, :, None] | exact[:, None, :], 0.0, after)


def _exterior(block: Block, frame: TangentFrame, near: Solution | None) -> Exterior:
    e = block.exterior
    guess = np.full(e.position_m.shape, np.nan) if near is None else near.images.position_m[e.image]
    position, covariance = _placed(frame, e.position_m, e.position_covariance_m2, guess)
    placed_rows = finite_rows(position)
    angles = e.angles_rad
    if block.rotation != "roll-pitch-heading" and placed_rows.any():
        turned = frame.axes_at(position[placed_rows]) @ rotation_from_angles(angles[placed_rows], block.rotation)
        angles = angles.copy()
        angles[placed_rows] = angles_from_rotation(turned, block.rotation)
    return replace(e, position_m=position, position_covariance_m2=covariance, angles_rad=angles)


def _solution(frame: TangentFrame, solution: Solution, *, into: bool) -> Solution:
    images, points = solution.images, solution.points
    if into:
        poses = poses_into(frame, images.position_m, images.ground_from_image)
        place = xyz = frame.from_block(points.xyz_m)
        at = poses.position_m
    else:
        poses = poses_out_of(frame, Poses(images.position_m, images.ground_from_image))
        place, at = points.xyz_m, images.position_m
        xyz = frame.to_block(place)
    D, turn = frame.derivatives_at(place), np.zeros((len(at), 6, 6))
    turn[:, :3, :3] = frame.derivatives_at(at)
    oriented = finite_rows(at)
    turn[oriented, 3:, 3:] = frame.axes_at(at[oriented]).swapaxes(1, 2)
    if into:
        D = np.linalg.inv(np.where(np.isfinite(D), D, np.eye(3)))
        turn = np.linalg.inv(np.where(oriented[:, None, None], turn, np.eye(6)))
    return replace(
        solution,
        images=replace(
            images,
            position_m=poses.position_m,
            ground_from_image=poses.ground_from_image,
            covariance=turn @ images.covariance @ turn.swapaxes(1, 2),
        ),
        points=replace(points, xyz_m=xyz, covariance_m2=D @ points.covariance_m2 @ D.swapaxes(1, 2)),
    )
