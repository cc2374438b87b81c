"""Starting orientations a Block itself gives."""

import numpy as np

from aatri.adapters.frame.adjustment_frame import geodesy_of
from aatri.arrays import Float
from aatri.artifacts.block import ANTENNA, Block
from aatri.geometry.rotations import exp_rotation
from aatri.observations.angle_differences import ObservedAngles
from aatri.observations.attitudes import ground_of_angles
from aatri.observations.observed import ObservationSource


def given_orientations(block: Block) -> tuple[Float, Float]:
    """Projection centres and rotations the block itself gives, observed or approximate; NaN where it gives none.

    Returns
    -------
    position_m : (n_images, 3) float64, m
    ground_from_image : (n_images, 3, 3) float64
    """
    n = len(block.images)
    position, rotation = np.full((n, 3), np.nan), np.full((n, 3, 3), np.nan)
    exterior = block.exterior
    with_angles = np.flatnonzero(np.isfinite(exterior.angles_rad).all(axis=1))
    if len(with_angles):
        image = exterior.image[with_angles]
        source = ObservationSource(block, None, np.zeros(3), {}, geodesy=geodesy_of(block))
        cameras = block.images.camera[image]
        ground = ground_of_angles(source, exterior.position_m[with_angles])
        mount_deg, angles_rad = block.cameras.mount_deg[cameras], exterior.angles_rad[with_angles]
        angles = ObservedAngles(angles_rad, block.rotation, ground, mount_deg)
        observed, _ = angles.rotations()
        rotation[image] = observed @ exp_rotation(block.cameras.boresight_rad[cameras])
    position[exterior.image] = exterior.position_m
    antenna = exterior.refers_to == ANTENNA
    image = exterior.image[antenna]
    arm = block.cameras.lever_arm_m[block.images.camera[image]]
    turned = np.einsum("nij,nj->ni", rotation[image], arm)
    position[image] -= np.where(np.isfinite(turned), turned, 0.0)
    return position, rotation
