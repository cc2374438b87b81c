"""Image refinement: lens distortion, atmospheric refraction, earth curvature, in this order, each at most once.

    1  distortion        measured -> perfect central projection, by the camera's model
    2  refraction        r <- r - K (r + r^3 / c^2)         K of the heights of station and terrain above sea level
    3  earth_curvature   r <- r + H' r^3 / (2 R c^2)        H' flying height above the terrain; map frames only

Each is evaluated at the coordinates the one before has left, x, y and r from the principal point. Methods and sources:
aatri.camera.

Earth curvature is corrected only where the block says `earth_curvature: correct` (a map frame with levelled heights);
in a Cartesian frame there is nothing to correct. Refraction and curvature hold for near-vertical images: with known
attitudes of more than 5 degrees they are refused.

The height of a station is that of its exterior position, observed or approximate (of the antenna where that is what it
refers to). Without positions it is estimated: c times ground over photo distances of the control points in the image,
above their mean height, the median over the strip. The height of the terrain is the block's `terrain_height`, or the
mean of the control.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from aatri.arrays import Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import Corrections, ImagePoints
from aatri.camera.corrections.earth_curvature import earth_curvature_correction
from aatri.camera.corrections.refraction import refraction_constant, refraction_correction
from aatri.errors import SpecError
from aatri.plugin import SILENT, Context, Field, Options, stage

from ._heights import Heights, heights_of, refuse_tilted
from ._lens import lens_correction


class SystematicOptions(Options):
    """Which corrections are applied."""

    distortion: bool = Field(True, description="correct lens distortion by the camera's model")
    refraction: bool = Field(True, description="correct atmospheric refraction (near-vertical images)")
    earth_curvature: bool = Field(True, description="correct earth curvature, if the block asks for it (map frame)")


@stage(version=1, uses=("images.strip", "cameras.distortion", "earth_curvature:correct"))
def systematic(
    block: Block,
    image_points: ImagePoints,
    *,
    options: SystematicOptions = SystematicOptions(),
    context: Context = SILENT,
) -> ImagePoints:
    """Photo coordinates freed from the systematic errors that are known beforehand."""
    wanted = _wanted(block, image_points, options, context)
    measurements = image_points.measurements
    xy = measurements.xy_mm.copy()
    rows = np.isfinite(xy).all(axis=1)
    image = measurements.image[rows]
    c = block.cameras.principal_distance_mm[block.images.camera[image]]
    heights = None
    if "refraction" in wanted or "earth_curvature" in wanted:
        refuse_tilted(block, wanted)
        heights = heights_of(block, image_points, context)
    largest = []
    for name in wanted:
        if name == "distortion":
            correction = lens_correction(block, image, xy[rows], context)
        else:
            assert heights is not None
            correction = _near_vertical_correction(name, xy[rows], heights, image, c)
        xy[rows] += correction
        used = measurements.active[rows]
        largest.append(float(np.sqrt((correction[used] ** 2).sum(axis=1)).max(initial=0.0)))
        context.log(f"{name}: at most {1e3 * largest[-1]:.2f} um")
    return replace(
        image_points,
        measurements=replace(measurements, xy_mm=xy),
        corrections=Corrections(
            name=np.concatenate([image_points.corrections.name, np.array(wanted, dtype=np.str_)]),
            largest_mm=np.concatenate([image_points.corrections.largest_mm, largest]),
        ),
    )


def _wanted(block: Block, image_points: ImagePoints, options: SystematicOptions, context: Context) -> list[str]:
    """The corrections to apply, in order."""
    wanted = [name for name in ("distortion", "refraction", "earth_curvature") if getattr(options, name)]
    twice = [name for name in wanted if name in image_points.corrections.name]
    if twice:
        raise SpecError(
            f"already applied to these image points: {', '.join(twice)}",
            where="image_refinement/systematic",
            remedy=f"switch off here: with: {{{', '.join(f'{name}: false' for name in twice)}}}",
        )
    if "earth_curvature" in wanted and block.earth_curvature != "correct":
        context.log(f"earth curvature is not corrected: the block says earth_curvature: {block.earth_curvature}")
        wanted.remove("earth_curvature")
    if "distortion" in wanted and (block.cameras.distortion == "none").all():
        context.log("no distortion is corrected: the cameras have none")
        wanted.remove("distortion")
    return wanted


def _near_vertical_correction(name: str, xy_mm: Float, heights: Heights, image: Int, c: Float) -> Float:
    station = heights.station_m[image]
    if name == "refraction":
        return refraction_correction(xy_mm, refraction_constant(station, heights.terrain_m), c)
    return earth_curvature_correction(xy_mm, station - heights.terrain_m, c)
