"""Starting orientations a Block itself gives."""

from __future__ import annotations

from typing import cast

import numpy as np

from aatri.arrays import Float
from aatri.artifacts.block import ANTENNA, Block
from aatri.errors import InputError
from aatri.geometry.rotations import AngleSystem, rotation_from_angles


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
