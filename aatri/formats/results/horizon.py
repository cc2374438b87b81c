"""An oriented block in another frame: in the horizon of a place, or geocentric, where a program knows no maps.

A block of a map that is moved into a Cartesian frame loses what maps distort; image points that were measured to fit
the map then fall elsewhere, by as much as is told.

Rays and cameras for programs whose cameras have one focal length and the principal point in the image centre.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from aatri.arrays import Float
from aatri.formats.conventions.lens import Lens
from aatri.formats.conventions.lens_conversion import as_program_states
from aatri.formats.limits import LEAST_CHANGE_PX
from aatri.formats.parts.block_parts import LOCAL, BlockParts
from aatri.formats.parts.of_block import frame_of
from aatri.formats.parts.one_frame import GEOCENTRIC, geographic, in_frame, tangent_place, topocentric
from aatri.formats.results.oriented_block import OrientedBlock
from aatri.frames.conversion import Frame
from aatri.frames.heights import is_tangent_frame
from aatri.geometry.collinearity import in_image_axes
from aatri.progress import Reporter


class MovedBlock(NamedTuple):
    """Orientations and points in a frame: images (n, 3) m and (n, 3, 3), points (p, 3) m, as in `OrientedBlock`."""

    frame: Frame
    position_m: Float
    ground_from_image: Float
    xyz_m: Float


class Horizon(NamedTuple):
    """A block in the horizon of a place; `reference_lla` is latitude, longitude, height, None of a local block."""

    moved: MovedBlock
    source: Frame
    reference_lla: tuple[float, float, float] | None

    def latitude_longitude_height(self, xyz_m: Float) -> list[float] | None:
        """Of coordinates in the frame of the block; None of a local block."""
        if self.reference_lla is None:
            return None
        longitude, latitude, height = geographic(np.nan_to_num(xyz_m)[None], self.source)[0].tolist()
        return [latitude, longitude, height]


def in_horizon(oriented: OrientedBlock, reporter: Reporter) -> Horizon:
    """The block in the horizon of its own frame, or of its middle; a local one as it is."""
    source = frame_of(oriented.block)
    if source == LOCAL or is_tangent_frame(source.crs):
        longitude, latitude, height = tangent_place(source)
        place = None if source == LOCAL else (latitude, longitude, height)
        return Horizon(as_it_is(oriented), source, place)
    places_m = [xyz[np.isfinite(xyz).all(axis=1)] for xyz in (oriented.position_m, oriented.xyz_m)]
    middle = np.median(np.concatenate(places_m), axis=0)
    longitude, latitude, _ = geographic(middle[None], source)[0].tolist()
    place = latitude, longitude, 0.0
    return Horizon(in_other_frame(oriented, topocentric(*place), reporter), source, place)


def as_it_is(oriented: OrientedBlock) -> MovedBlock:
    """Orientations and points in the frame of the block itself."""
    return MovedBlock(frame_of(oriented.block), oriented.position_m, oriented.ground_from_image, oriented.xyz_m)


def in_other_frame(oriented: OrientedBlock, target: Frame, reporter: Reporter) -> MovedBlock:
    """Orientations and points in another frame; what this does to the image points is told."""
    exterior = {"position_m": oriented.position_m, "ground_from_image": oriented.ground_from_image}
    ground_points = {"xyz_m": oriented.xyz_m, "role": 0}
    parts = BlockParts("aatri", [], frame=frame_of(oriented.block), exterior=exterior, ground_points=ground_points)
    parts = in_frame(parts, target, reporter)
    moved = MovedBlock(target, *map(np.asarray, (*parts.exterior.values(), parts.ground_points["xyz_m"])))
    if (apart_px := _changed_px(oriented, moved)) > LEAST_CHANGE_PX:
        what = f"moved from {oriented.block.frames.crs[0]} into {'the earth' if target == GEOCENTRIC else 'a horizon'}"
        reporter.log(f"{what}: image points fall up to {apart_px:.2g} px elsewhere, which maps distort")
    return moved


def _changed_px(oriented: OrientedBlock, moved: MovedBlock) -> float:
    """Largest distance between where points are seen before and after, px."""
    rays = oriented.rays
    usable = oriented.oriented[rays.image] & np.isfinite(oriented.xyz_m[rays.point]).all(axis=1)
    image, point = rays.image[usable], rays.point[usable]
    if not len(image):
        return 0.0
    seen = [
        u[:, :2] / u[:, 2:]
        for u in (
            in_image_axes(b.position_m[image], b.ground_from_image[image], b.xyz_m[point]) for b in (oriented, moved)
        )
    ]
    focal = np.array([lens.focal_px for lens in oriented.lenses])[oriented.block.images.camera[image]]
    return float(np.abs((seen[1] - seen[0]) * focal).max())


def centred_cameras(
    oriented: OrientedBlock, forms: Sequence[str], reporter: Reporter, *, allowed_px: float
) -> tuple[dict[int, Lens], Float]:
    """Cameras by row, and the rays of the model (m, 2) from the principal point, y down, in pixels of their width.

    A distortion is in units of the focal length, so that another height of the pixels does not change it.

    Raises
    ------
    InputError
        If a distortion is none of the forms within `allowed_px`.
    """
    rays = oriented.model_rays
    camera, xy_px = oriented.block.images.camera[rays.image], rays.xy_px.copy()
    lenses = {}
    for k in np.unique(camera).tolist():
        lens = oriented.lenses[k]
        (width, height), (fx, fy), point = lens.size_px, lens.focal_px, np.array(lens.principal_point_px)
        xy_px[camera == k] = (xy_px[camera == k] - point) * [1.0, fx / fy]
        square = (width + 2 * abs(point[0]), (height + 2 * abs(point[1])) * fx / fy)
        centred = replace(lens, size_px=square, focal_px=(fx, fx), principal_point_px=(0.0, 0.0))
        lenses[k] = as_program_states(centred, forms, reporter, allowed_px=allowed_px)
    return lenses, xy_px
