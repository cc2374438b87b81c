"""Refraction of tilted images: poses of a finished orientation, level axes at the stations, heights."""

from __future__ import annotations

import numpy as np

from aatri.adapters.refinement.heights import terrain_height
from aatri.arrays import Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.solution import Solution
from aatri.camera.corrections.atmospheres import Atmosphere, constant_of
from aatri.camera.corrections.ray_refraction import refraction_of_rays
from aatri.errors import GeometryError
from aatri.frames.heights import height_above_sea_level, is_tangent_frame
from aatri.ids import shown
from aatri.notes import Note
from aatri.units import EARTH_RADIUS_M


def refraction_by_poses(
    block: Block, poses: Solution, image: Int, xy_mm: Float, atmosphere: Atmosphere
) -> tuple[Float, tuple[Note, ...]]:
    """Correction of every ray in its vertical plane, (n, 2) float64, mm; 0 in images without orientation.

    Parameters
    ----------
    poses : Solution
        Orientations of the images of the block.
    image : (n,) int
    xy_mm : (n, 2) float64, mm, from the principal point

    Raises
    ------
    GeometryError
        If a station does not lie above the terrain, or rays are flatter than 80 degrees from the nadir.
    """
    tangent = is_tangent_frame(str(block.frames.crs[0]) if len(block.frames) else "")
    position, notes = poses.images.position_m, list[Note]()
    used = np.unique(image)
    known = poses.images.oriented & np.isfinite(position).all(axis=1)
    without = used[~known[used]]
    if len(without):
        names = tuple(block.images.id[without].tolist())
        notes.append(Note("warning", "refraction is not corrected in images without orientation", names))
    terrain = terrain_height(block, tangent)
    station = np.where(known, height_above_sea_level(position, tangent=tangent), np.nan)
    below = used[known[used] & ~(station[used] > terrain)]
    if len(below):
        raise GeometryError(
            f"stations not above the terrain ({terrain:.1f} m): {shown(block.images.id[below])}",
            remedy="check terrain_height and the orientations in `solution`: heights count from sea level",
        )
    rays = np.flatnonzero(known[image])
    of, c = image[rays], block.cameras.principal_distance_mm[block.images.camera[image[rays]]]
    R = poses.images.ground_from_image[of]
    level = _level_axes(position[of]) @ R if tangent else R
    constant = constant_of(atmosphere, station[of], terrain)
    correction = np.zeros_like(xy_mm)
    correction[rays] = refraction_of_rays(xy_mm[rays], c, level, constant)
    flat = np.unique(image[~np.isfinite(correction).all(axis=1)])
    if len(flat):
        raise GeometryError(
            f"rays flatter than 80 degrees from the nadir in {shown(block.images.id[flat])}: plane layers of air "
            "do not hold for them",
            remedy="check the orientations in `solution`; or leave refraction out: with: {refraction: false}",
        )
    return correction, tuple(notes)


def _level_axes(place: Float) -> Float:
    """Rotations from a tangent frame of the sphere to axes with z up at places of it, (n, 3, 3)."""
    up = place + np.array([0.0, 0.0, EARTH_RADIUS_M])
    up = up / np.linalg.norm(up, axis=1, keepdims=True)
    east = np.cross(np.broadcast_to([0.0, 1.0, 0.0], up.shape), up)
    east = east / np.linalg.norm(east, axis=1, keepdims=True)
    return np.stack([east, np.cross(up, east), up], axis=1)
