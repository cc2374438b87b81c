"""Heights of stations and terrain above sea level, and tilts, as far as the block tells them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Bool, Float
from aatri.artifacts.block import CONTROL, Block
from aatri.artifacts.image_points import ImagePoints
from aatri.errors import GeometryError
from aatri.frames.heights import height_above_sea_level, is_tangent_frame
from aatri.geometry.rotations import rotation_from_angles
from aatri.ids import shown
from aatri.notes import Note
from aatri.orientation.refinement.flying_height import station_heights_m

MOST_TILT_RAD = np.deg2rad(5.0)
"""Refraction and curvature corrections assume near-vertical images."""


@dataclass(frozen=True)
class Heights:
    """Heights above sea level.

    Attributes
    ----------
    station_m : (n,) float64, m
        Of the projection centre of each image of the Block; NaN for images without image points.
    terrain_m : float, m
    """

    station_m: Float
    terrain_m: float


def heights_of(block: Block, image_points: ImagePoints) -> tuple[Heights, tuple[Note, ...]]:
    """Heights of the stations from their positions, else estimated by the photo scale; height of the terrain.

    Raises
    ------
    GeometryError
        If the block does not tell the heights, or a station lies below the terrain.
    """
    tangent = is_tangent_frame(str(block.frames.crs[0]) if len(block.frames) else "")
    terrain = terrain_height(block, tangent)
    station = np.full(len(block.images), np.nan)
    station[block.exterior.image] = height_above_sea_level(block.exterior.position_m, tangent=tangent)
    notes: list[Note] = []
    needed = np.zeros(len(station), dtype=bool)
    needed[image_points.measurements.image[np.isfinite(image_points.measurements.xy_mm).all(axis=1)]] = True
    missing = needed & np.isnan(station)
    if missing.any():
        station = np.where(missing, _estimated_by_strip(block, image_points, tangent), station)
        _refuse_unknown(block, needed & np.isnan(station))
        text = f"flying height of {int(missing.sum())} images estimated from the photo scale at control points"
        notes.append(Note("note", text))
    below = needed & ~(station > terrain)
    if below.any():
        raise GeometryError(
            f"stations not above the terrain ({terrain:.1f} m): {shown(block.images.id[below])}",
            remedy="check terrain_height and the heights in exterior.csv: both count from sea level",
        )
    return Heights(np.where(needed, station, np.nan), terrain), tuple(notes)


def refuse_tilted(block: Block, corrections: list[str]) -> None:
    """Refuse near-vertical corrections where attitudes tell that images are not near-vertical.

    Raises
    ------
    GeometryError
        Naming the images tilted by more than 5 degrees.
    """
    known = np.isfinite(block.exterior.angles_rad).all(axis=1) & block.images.active[block.exterior.image]
    angles = block.exterior.angles_rad[known]
    if block.rotation in ("omega-phi-kappa", "phi-omega-kappa"):
        cosine = rotation_from_angles(angles, block.rotation)[:, 2, 2]  # type: ignore[arg-type]
    else:  # roll and pitch of the carrier
        cosine = np.cos(angles[:, 0]) * np.cos(angles[:, 1])
    tilted = block.exterior.image[known][cosine < np.cos(MOST_TILT_RAD)]
    if len(tilted):
        names = " and ".join(n.replace("_", " ") for n in corrections if n != "distortion")
        raise GeometryError(
            f"{names} corrections hold for near-vertical images; tilted by more than 5 degrees: "
            f"{shown(block.images.id[tilted])}",
            remedy="give orientations (`solution` in `from:`) for refraction by rays; for earth curvature adjust in a "
            "tangent frame (earth_curvature: frame)",
        )


def _control_rows(block: Block, coordinates: list[int]) -> Bool:
    points = block.ground_points
    control = (points.role == CONTROL) & np.isfinite(points.xyz_m)
    return np.asarray(control[:, coordinates].all(axis=1))


def terrain_height(block: Block, tangent: bool) -> float:
    """Height of the terrain above sea level, m: that of the block, or the mean of the control.

    Raises
    ------
    GeometryError
        If neither tells it.
    """
    if np.isfinite(block.terrain_height_m):
        return block.terrain_height_m
    xyz = block.ground_points.xyz_m[_control_rows(block, [2])]
    if tangent:  # where plan is not given, the height at the origin is as good as can be known
        xyz = np.column_stack([np.nan_to_num(xyz[:, :2]), xyz[:, 2]])
    if not len(xyz):
        raise GeometryError(
            "refraction and earth curvature need the height of the terrain",
            remedy="give terrain_height in block.yaml, or control points with heights; or switch them off",
        )
    return float(height_above_sea_level(xyz, tangent=tangent).mean())


def _estimated_by_strip(block: Block, image_points: ImagePoints, tangent: bool) -> Float:
    """Per image the median over its strip of the flying heights that the photo scale gives, m above sea level."""
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
    estimated = single.copy()
    for s in np.unique(strip[strip >= 0]):
        mine = strip == s
        if np.isfinite(single[mine]).any():
            estimated[mine] = np.nanmedian(single[mine])
    return estimated


def _refuse_unknown(block: Block, unknown: Bool) -> None:
    if unknown.any():
        raise GeometryError(
            f"refraction and earth curvature need the flying height; not known for {int(unknown.sum())} images: "
            f"{shown(block.images.id[unknown])}",
            remedy="give approximate positions in exterior.csv, or two control points in one image of each strip; "
            "or switch both corrections off",
        )
