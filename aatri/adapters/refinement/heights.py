"""Heights of stations and terrain above sea level, and level axes, as far as block and orientations tell them."""

from dataclasses import dataclass

import numpy as np

from aatri.adapters.limits import MOST_TILT_RAD
from aatri.arrays import Bool, Float, finite_rows
from aatri.artifacts.block import CONTROL, Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.frames.heights import height_above_sea_level, is_tangent_frame
from aatri.geometry.rotations import ENU_FROM_NED, angle_axes, body_from_mount
from aatri.ids import several
from aatri.notes import Note
from aatri.orientation.refinement.flying_height import heights_by_bases_m, station_heights_m
from aatri.units import EARTH_RADIUS_M


@dataclass(frozen=True)
class Stations:
    """What is known of the stations of all images of a block."""

    height_m: Float
    """(n,), m. Above sea level; NaN where not known."""
    terrain_m: float
    """Mean height of the terrain above sea level; NaN where not known."""
    level_from_image: Float
    """(n, 3, 3). Rotations of the images to level axes at their stations, z up; NaN where not known."""
    by_rays: Bool
    """(n,). Images whose rays are corrected each in its own vertical plane: oriented, or tilted too much for closed
    forms."""


def stations_of(block: Block, image_points: ImagePoints, poses: Solution | None) -> tuple[Stations, tuple[Note, ...]]:
    """Stations as orientations tell them, else their positions and attitudes, else the photo scale."""
    tangent = is_tangent_frame(str(block.frames.crs[0]) if len(block.frames) else "")
    place = block.positions_m
    level = np.full((len(block.images), 3, 3), np.nan)
    level[block.exterior.image] = _level_by_angles(block, tangent)
    oriented = np.zeros(len(block.images), dtype=bool)
    if poses is not None:
        oriented = poses.images.oriented & finite_rows(poses.images.position_m)
        place[oriented] = poses.images.position_m[oriented]
        R = poses.images.ground_from_image[oriented]
        level[oriented] = _level_axes(place[oriented]) @ R if tangent else R
    station = height_above_sea_level(place, tangent=tangent)
    notes: list[Note] = []
    terrain = _terrain_height(block, tangent)
    if np.isnan(terrain):
        terrain = _terrain_by_bases(block, image_points, place, station)
        if np.isfinite(terrain):
            text = f"height of the terrain, {terrain:.0f} m, estimated from the photo scale at neighbouring positions"
            notes.append(Note("note", text))
    missing = np.isnan(station)
    missing &= np.isin(np.arange(len(station)), image_points.measurements.image)
    if missing.any():
        estimated = _estimated_by_strip(block, image_points, station, tangent)
        station = np.where(missing, estimated, station)
        count = int((missing & np.isfinite(station)).sum())
        if count:
            images = several(count, "image")
            text = f"flying height of {images} estimated from the scale at control points, or other images"
            notes.append(Note("note", text))
    tilted = level[:, 2, 2] < np.cos(MOST_TILT_RAD)
    by_rays = tilted if poses is None else oriented | tilted | np.isnan(level[:, 2, 2])
    return Stations(station, terrain, level, by_rays), tuple(notes)


def _level_by_angles(block: Block, tangent: bool) -> Float:
    """Of the rows of the exterior; NaN where an angle is not given."""
    exterior = block.exterior
    complete = finite_rows(exterior.angles_rad) & block.images.active[exterior.image]
    angles = np.where(complete[:, None], exterior.angles_rad, 0.0)
    level: Float = angle_axes(angles, block.rotation)[0]
    if block.rotation == "roll-pitch-heading":
        level = ENU_FROM_NED @ level @ body_from_mount(block.cameras.mount_deg[block.images.camera[exterior.image]])
    elif tangent:
        level = _level_axes(np.nan_to_num(exterior.position_m)) @ level
    return np.where(complete[:, None, None], level, np.nan)


def _level_axes(place: Float) -> Float:
    """Rotations from a tangent frame of the sphere to axes with z up at places of it, (n, 3, 3)."""
    up = place + np.array([0.0, 0.0, EARTH_RADIUS_M])
    up = up / np.linalg.norm(up, axis=1, keepdims=True)
    east = np.cross(np.broadcast_to([0.0, 1.0, 0.0], up.shape), up)
    east = east / np.linalg.norm(east, axis=1, keepdims=True)
    return np.stack([east, np.cross(up, east), up], axis=1)


def _control_rows(block: Block, coordinates: list[int]) -> Bool:
    points = block.ground_points
    control = (points.role == CONTROL) & np.isfinite(points.xyz_m)
    return np.asarray(control[:, coordinates].all(axis=1))


def _terrain_height(block: Block, tangent: bool) -> float:
    """Height of the terrain above sea level, m: that of the block, or the mean of the control; NaN without."""
    if np.isfinite(block.terrain_height_m):
        return block.terrain_height_m
    xyz = block.ground_points.xyz_m[_control_rows(block, [2])]
    if tangent:  # where plan is not given, the height at the origin is as good as can be known
        xyz = np.column_stack([np.nan_to_num(xyz[:, :2]), xyz[:, 2]])
    return float(height_above_sea_level(xyz, tangent=tangent).mean()) if len(xyz) else float("nan")


def _terrain_by_bases(block: Block, image_points: ImagePoints, place: Float, station: Float) -> float:
    """Height of the stations less what the photo scale at neighbouring ones gives; NaN where none have positions."""
    images, m = block.images, image_points.measurements
    order = np.lexsort((images.sequence, images.strip))
    order = order[np.isfinite(station[order])]
    first, second = order[:-1], order[1:]
    of_strip = images.strip[first] == images.strip[second]
    first, second = first[of_strip], second[of_strip]
    use = m.active & finite_rows(m.xy_mm)
    c = block.cameras.principal_distance_mm[images.camera]
    above = heights_by_bases_m(first, second, m.image[use], m.point[use], m.xy_mm[use], place[:, :2], c)
    has_height = np.isfinite(above)
    return float(np.median(station[first][has_height] - above[has_height])) if has_height.any() else float("nan")


def _estimated_by_strip(block: Block, image_points: ImagePoints, known_m: Float, tangent: bool) -> Float:
    """Heights of stations above sea level, m: the median of the strip by photo scale, or of those that are known."""
    full = np.flatnonzero(_control_rows(block, [0, 1, 2]))
    ground = np.full((len(block.points), 3), np.nan)
    ground[block.ground_points.point[full]] = block.ground_points.xyz_m[full]
    height = height_above_sea_level(ground, tangent=tangent)
    measurements = image_points.measurements
    use = measurements.active & np.isfinite(ground[measurements.point]).all(axis=1)
    image, point, xy = measurements.image[use], measurements.point[use], measurements.xy_mm[use]
    c = block.cameras.principal_distance_mm[block.images.camera]
    single = station_heights_m(image, xy, ground[point, :2], height[point], c)
    strip = block.images.strip
    strips = [strip == s for s in np.unique(strip[strip >= 0])]
    estimated = single.copy()
    # The last choice first: all that is known of the block, of the strip, and the photo scale in the strip.
    every = np.ones(len(strip), dtype=bool)
    for values, parts in ((known_m, [every]), (single, [every]), (known_m, strips), (single, strips)):
        for of_part in parts:
            if np.isfinite(values[of_part]).any():
                estimated[of_part] = np.nanmedian(values[of_part])
    return estimated
