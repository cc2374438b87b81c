"""The frame of an adjustment: the tangent frame of the block's CRS, or the block's own; and the way there and back.

A block with `earth_curvature: frame` is adjusted in a tangent frame at its middle. What goes in and comes out is in the
first frame of the block: coordinates by the map, rotations against grid and ellipsoid normal at the projection centre,

    R_tangent = B R_block,    C_block = D C_tangent D',    d_block = B' d_tangent

with D and B of `aatri.frames.tangent`. In any other block both frames are the same, and what that neglects is stated.

Methods that find approximate orientations take a block with all that is given of the ground in its tangent frame, and
know nothing of maps; their Solution is brought back (`in_tangent_frame`). Whole positions are converted exactly, with
their covariances. Control or a position in plan or in height only has no place of its own: what it lacks is taken from
a solution that has it, and from the mean of the block before there is one. The error is that of the lacking coordinate
times the distance from the origin over the radius of the earth; the bundle, which takes such coordinates as they are
given, has none.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from aatri.arrays import Float, finite_rows
from aatri.artifacts.block import Block, Exterior, GroundPoints
from aatri.artifacts.solution import Solution
from aatri.errors import AatriError, InputError
from aatri.frames.conversion import Frame
from aatri.frames.tangent import TangentFrame, check_convertible, tangent_frame
from aatri.geometry.rotations import angles_from_rotation, rotation_from_angles
from aatri.observations.poses import POINT, POSE, Poses

if TYPE_CHECKING:  # readers of files import this, and need no method
    from aatri.orientation.bundle.result import BundleResult


def frame_of(block: Block, origin: Float | None = None) -> TangentFrame | None:
    """The frame in which a block is adjusted; None if it is the block's own.

    Parameters
    ----------
    origin : (3,) float64, optional
        Coordinates of its origin in the block's frame; default the middle of the block.

    Raises
    ------
    InputError
        If the block asks for a tangent frame that its CRS does not allow.
    """
    if block.earth_curvature != "frame":
        return None
    source, undulation_m = declared_frame(block)
    return tangent_frame(source, _middle(block) if origin is None else origin, undulation_m)


def geodesy_of(block: Block, frame: TangentFrame | None = None) -> TangentFrame | None:
    """A tangent frame of the block's CRS, whatever its adjustment is in; None where the CRS cannot be converted."""
    if frame is not None or not len(block.frames) or block.frames.crs[0] == "local":
        return frame
    try:
        source, undulation_m = declared_frame(block)
        return tangent_frame(source, _middle(block), undulation_m)
    except AatriError:
        return None


def declared_frame(block: Block) -> tuple[Frame, float]:
    """The first frame of the block as it can be converted, and the undulation that stands for its geoid grid.

    Raises
    ------
    InputError
        If there is no CRS, or a grid is missing and no undulation is given.
    """
    frames = block.frames
    axes = ("x", "y", "z") if "x" in str(frames.axes[0]).split(",") else ("east", "north", "up")
    source = Frame(str(frames.id[0]), axes, str(frames.crs[0]), str(frames.vertical[0]))
    undulation = float(np.nan_to_num(block.undulation_m))
    if not source.vertical:
        check_convertible(source)
        return source, undulation
    try:
        check_convertible(source)
        return source, 0.0
    except InputError as error:
        if not undulation:
            remedy = f"{error.remedy}; or give undulation, or write earth_curvature: correct"
            raise InputError(error.what, where=error.where, remedy=remedy) from error
        source = replace(source, vertical="")
        check_convertible(source)
        return source, undulation


def _middle(block: Block) -> Float:
    """A round place in the middle of what the block knows, at height 0; of geocentric blocks as it is."""
    ground, position = block.ground_points.xyz_m, block.exterior.position_m
    places = [
        ground[finite_rows(ground)],
        position[finite_rows(position)],
        np.nan_to_num(ground[np.isfinite(ground).any(axis=1)]),
        np.nan_to_num(position[finite_rows(position[:, :2])]),
    ]
    xyz = next((rows for rows in places if len(rows)), None)
    if xyz is None:
        raise InputError(
            "a tangent frame needs a place: the block has neither ground points nor positions",
            where=f"block {block.name}",
            remedy="give control or positions, or write earth_curvature: ignore",
        )
    middle = np.asarray(np.round(xyz.mean(axis=0)))
    return middle if "x" in str(block.frames.axes[0]).split(",") else middle * np.array([1.0, 1.0, 0.0])


def poses_into(frame: TangentFrame | None, position_m: Float, ground_from_image: Float) -> Poses:
    """Poses of the block in the frame of the adjustment; NaN stays NaN."""
    if frame is None:
        return Poses(position_m, ground_from_image)
    position = frame.from_block(position_m)
    return Poses(position, _axes(frame, position) @ ground_from_image)


def poses_out_of(frame: TangentFrame | None, poses: Poses) -> Poses:
    """Poses of the adjustment in the frame of the block."""
    if frame is None:
        return poses
    back = _axes(frame, poses.position_m).swapaxes(1, 2)
    return Poses(frame.to_block(poses.position_m), back @ poses.ground_from_image)


def points_into(frame: TangentFrame | None, xyz: Float) -> Float:
    """Points of the block in the frame of the adjustment; a point of which a coordinate is missing has none there."""
    return xyz if frame is None else frame.from_block(xyz)


def points_out_of(frame: TangentFrame | None, xyz_m: Float) -> Float:
    """Points of the adjustment in the frame of the block."""
    return xyz_m if frame is None else frame.to_block(xyz_m)


def solution_into(frame: TangentFrame | None, solution: Solution) -> tuple[Poses, Float]:
    """Poses and points (n, 3) of a Solution in the frame of the adjustment."""
    images = solution.images
    return poses_into(frame, images.position_m, images.ground_from_image), points_into(frame, solution.points.xyz_m)


def result_out_of(frame: TangentFrame | None, result: BundleResult) -> BundleResult:
    """An adjusted block with poses, points and their covariances in the frame of the block.

    Residuals are in the axes of the block already; `adjusted` stays as it is.
    """
    if frame is None:
        return result
    position, xyz = result.poses.position_m, result.xyz_m
    turn = np.zeros((len(position), 6, 6))
    turn[:, :3, :3] = frame.derivatives_at(position)
    turn[:, 3:, 3:] = _axes(frame, position).swapaxes(1, 2)
    D = frame.derivatives_at(xyz)
    covariances = {
        **result.covariances,
        POSE: turn @ result.covariances[POSE] @ turn.swapaxes(1, 2),
        POINT: D @ result.covariances[POINT] @ D.swapaxes(1, 2),
    }
    return replace(result, poses=poses_out_of(frame, result.poses), xyz_m=frame.to_block(xyz), covariances=covariances)


def _axes(frame: TangentFrame, position_m: Float) -> Float:
    places = finite_rows(position_m)
    B = np.full((len(position_m), 3, 3), np.nan)
    B[places] = frame.axes_at(position_m[places])
    return B


@dataclass(frozen=True)
class InTangentFrame:
    """A block, and a solution of it, in the frame of the adjustment; as given where that is the block's own."""

    block: Block
    initial: Solution | None
    frame: TangentFrame | None

    def back(self, solution: Solution) -> Solution:
        """A Solution made of it, in the frame of the block."""
        return solution if self.frame is None else _turned_solution(self.frame, solution, into=False)


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
        frames=replace(block.frames, crs=np.array(["local", *block.frames.crs[1:]], dtype=np.str_)),
        ground_points=_ground(block, frame, initial),
        exterior=_exterior(block, frame, initial),
    )
    return InTangentFrame(moved, _turned_solution(frame, initial, into=True) if initial else None, frame)


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


def _turned_solution(frame: TangentFrame, solution: Solution, *, into: bool) -> Solution:
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
