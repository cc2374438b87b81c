"""What a Block gives to an adjustment: control by coordinate, observed positions, starting orientations.

A control coordinate of variance zero is held at its value; any other is an observation.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import ANTENNA, CONTROL, OBSERVED_VALUE, Block
from aatri.errors import InputError
from aatri.geometry.rotations import AngleSystem, rotation_from_angles


@dataclass(frozen=True)
class Control:
    """Control points.

    Attributes
    ----------
    row : (n,) int32
        Row in the Block's ground_points.
    point : (n,) int32
        Row in points.
    xyz_m : (n, 3) float64, m
    covariance_m2 : (n, 3, 3) float64, m^2
    observed : (n, 3) bool
        The coordinate is control, with a standard deviation.
    held : (n, 3) bool
        The coordinate is control and exact.
    """

    row: Int
    point: Int
    xyz_m: Float
    covariance_m2: Float
    observed: Bool
    held: Bool


def control_of(block: Block) -> Control:
    """Control points of a block, in the order of its ground_points."""
    ground = block.ground_points
    wanted = (ground.role == CONTROL) & np.isfinite(ground.xyz_m)
    row = np.flatnonzero(wanted.any(axis=1)).astype(np.int32)
    exact = np.einsum("nii->ni", ground.covariance_m2)[row] == 0
    return Control(
        row,
        ground.point[row],
        ground.xyz_m[row],
        ground.covariance_m2[row],
        wanted[row] & ~exact,
        wanted[row] & exact,
    )


@dataclass(frozen=True)
class Positions:
    """Observed positions of projection centres or antennas.

    Attributes
    ----------
    row : (n,) int32
        Row in the Block's exterior.
    image : (n,) int32
        Row in images.
    position_m : (n, 3) float64, m
    covariance_m2 : (n, 3, 3) float64, m^2
    lever_arm_m : (n, 3) float64, m, camera axes
        Zero where the projection centre itself was observed.
    """

    row: Int
    image: Int
    position_m: Float
    covariance_m2: Float
    lever_arm_m: Float


def positions_of(block: Block) -> Positions:
    """Observed positions of a block, in the order of its exterior table."""
    exterior = block.exterior
    known = np.isfinite(exterior.position_m).all(axis=1) & (exterior.position_use == OBSERVED_VALUE)
    row = np.flatnonzero(known & block.images.active[exterior.image]).astype(np.int32)
    image = exterior.image[row]
    arm = block.cameras.lever_arm_m[block.images.camera[image]]
    arm = np.where((exterior.refers_to[row] == ANTENNA)[:, None], arm, 0.0)
    return Positions(row, image, exterior.position_m[row], exterior.position_covariance_m2[row], arm)


def given_orientations(block: Block) -> tuple[Float, Float]:
    """Projection centres and rotations the block itself gives, observed or approximate; NaN where it gives none.

    Returns
    -------
    position_m : (n_images, 3) float64, m
    ground_from_image : (n_images, 3, 3) float64

    Raises
    ------
    InputError
        If attitudes are roll, pitch and heading: they need the mount of the camera.
    """
    n = len(block.images)
    position, rotation = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan)
    exterior = block.exterior
    angles_known = np.isfinite(exterior.angles_rad).all(axis=1)
    if angles_known.any():
        if block.rotation == "roll-pitch-heading":
            raise InputError(
                "attitudes are roll, pitch, heading; these are not angles of the image",
                where=f"block {block.name}",
                remedy="give omega-phi-kappa or phi-omega-kappa, or set `from: initial`",
            )
        system = cast(AngleSystem, block.rotation)
        rotation[exterior.image[angles_known]] = rotation_from_angles(exterior.angles_rad[angles_known], system)
    position[exterior.image] = exterior.position_m
    antenna = exterior.refers_to == ANTENNA
    image = exterior.image[antenna]
    arm = block.cameras.lever_arm_m[block.images.camera[image]]
    turned = np.einsum("nij,nj->ni", rotation[image], arm)
    position[image] -= np.where(np.isfinite(turned), turned, 0.0)
    return position, rotation
