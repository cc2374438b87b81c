"""Refraction and earth curvature of the image points of a block, by closed forms or ray by ray.

What the block does not tell enough for is left out, and told with its size: these corrections are micrometres.
"""

import numpy as np

from aatri.adapters.refinement.heights import Stations
from aatri.adjustment.threads import by_rows
from aatri.arrays import Bool, Float, Int, finite_rows
from aatri.artifacts.block import Block
from aatri.camera.corrections.atmosphere import Atmosphere, constant_of
from aatri.camera.corrections.vertical_planes import FLATTEST_RAD, earth_curvature_correction, refraction_correction
from aatri.ids import several
from aatri.notes import Level, Note

FOR_EXAMPLE_M = 1000.0
"""Flying height for which the size is told where it is not known."""


def earth_correction(
    name: str, block: Block, stations: Stations, image: Int, xy_mm: Float, sigma_mm: Float, atmosphere: Atmosphere
) -> tuple[Float, tuple[Note, ...]]:
    """Correction of every image point, (n, 2) float64, mm, and what is left out.

    Parameters
    ----------
    name : str
        `refraction` or `earth_curvature`.
    image : (n,) int
    xy_mm, sigma_mm : (n, 2) float64, mm
        From the principal point; standard deviations.
    """
    above = stations.height_m - stations.terrain_m
    low = np.unique(image[above[image] <= 0])
    unknown = np.isnan(above[image])
    c = block.cameras.principal_distance_mm[block.images.camera[image]]
    what, notes = name.replace("_", " "), list[Note]()

    def corrected(rows: Int | Bool | slice, station_m: Float, terrain_m: float, level: Float | None = None) -> Float:
        def one(xy: Float, station: Float, distance: Float, *axes: Float) -> Float:
            if name == "refraction":
                return refraction_correction(xy, constant_of(atmosphere, station, terrain_m), distance, *axes)
            return earth_curvature_correction(xy, station - terrain_m, distance, *axes)

        return by_rows(one, xy_mm[rows], station_m, c[rows], *([] if level is None else [level]))

    above_terrain, rays = above[image] > 0, stations.by_rays[image]
    if above_terrain.all() and not rays.any():  # the usual case
        every = corrected(slice(None), stations.height_m[image], stations.terrain_m)
        if np.isfinite(every).all():
            return every, ()
    correction, turned = np.zeros_like(xy_mm), np.isfinite(stations.level_from_image[image, 2, 2])
    for rows, axes in ((above_terrain & ~rays, None), (above_terrain & rays & turned, stations.level_from_image)):
        row_image = image[rows]
        own = None if axes is None else axes[row_image]
        correction[rows] = corrected(rows, stations.height_m[row_image], stations.terrain_m, own)
    without = above_terrain & rays & ~turned
    if without.any():
        text = f"{what} is not corrected in images without orientation"
        notes.append(Note("warning", text, _ids(block, image[without])))
    if len(low):
        text = f"{what} is not corrected where stations lie not above the terrain ({stations.terrain_m:.1f} m); check "
        notes.append(Note("warning", text + "terrain_height and the heights of the positions", _ids(block, low)))
    flat = ~finite_rows(correction)
    if flat.any():
        text = f"{what} is not corrected in {several(int(flat.sum()), 'image point')} whose rays are flatter than "
        text += f"{np.degrees(FLATTEST_RAD):.0f} degrees from the nadir, where plane layers do not hold"
        notes.append(Note("note", text, _ids(block, image[flat])))
        correction[flat] = 0.0
    if unknown.any():
        terrain = float(np.nan_to_num(stations.terrain_m))
        there = corrected(unknown, np.full(int(unknown.sum()), terrain + FOR_EXAMPLE_M), terrain)
        size = float(np.hypot(*there.T).max())
        text = (
            f"{what} is not corrected in images whose height above the terrain is not known: at most "
            f"{1e3 * size:.1f} um for each {FOR_EXAMPLE_M:.0f} m of it; give terrain_height, and positions in "
            "exterior.csv"
        )
        level: Level = "warning" if size > float(np.median(sigma_mm[unknown])) else "note"
        notes.append(Note(level, text, _ids(block, image[unknown])))
    return correction, tuple(notes)


def _ids(block: Block, image: Int) -> tuple[str, ...]:
    return tuple(block.images.id[np.unique(image)].tolist())
