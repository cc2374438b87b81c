"""How far, in px, image points are from where the Block of some parts sees their ground points, by its camera model."""

from __future__ import annotations

from typing import Any

import numpy as np

from aatri.arrays import Float
from aatri.artifacts.block import Block
from aatri.camera.models.distortion import Distortion, corrected
from aatri.camera.pixels import mm_from_pixel
from aatri.geometry.rotations import rotation_from_angles


def misfit_px(block: Block, image: str, xy: Any, xyz_m: Any) -> Float:
    """Distance in px between ideal image points of measurements `xy` and the central projection of `xyz_m`, (n,)."""
    row = block.images.id.tolist().index(image)
    k = int(block.images.camera[row])
    cameras, given = block.cameras, block.camera_parameters
    rows = (given.camera == k) & np.isfinite(given.value)
    parameters = dict(zip(given.name[rows].tolist(), given.value[rows].tolist()))
    c = float(cameras.principal_distance_mm[k])
    if cameras.image_coordinates[k] == "photo":
        xy_mm = np.asarray(xy, float)
    else:
        matrix = mm_from_pixel(cameras.pixel_size_mm[k], cameras.pixel_origin[k], cameras.pixel_y[k], cameras.format[k])
        xy_mm = np.asarray(xy, float) @ matrix[:, :2].T + matrix[:, 2]
    table = block.distortion_table
    own = np.asarray(table.camera == k) if table is not None else np.zeros(0, bool)
    lens = Distortion(
        str(cameras.distortion[k]),
        c,
        parameters,
        radius_mm=table.radius_mm[own] if own.any() else np.zeros(0),
        correction_mm=table.correction_mm[own] if own.any() else np.zeros(0),
    )
    ideal = corrected(lens, xy_mm - cameras.principal_point_mm[k])
    at = int(np.flatnonzero(block.exterior.image == row)[0])
    R = rotation_from_angles(block.exterior.angles_rad[at])
    u = (np.asarray(xyz_m, float) - block.exterior.position_m[at]) @ R
    assert (u[:, 2] < 0).all(), "points lie behind the camera"
    return np.asarray(np.linalg.norm((ideal + c * u[:, :2] / u[:, 2:]) / cameras.pixel_size_mm[k], axis=1))
