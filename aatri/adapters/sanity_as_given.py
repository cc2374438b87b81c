"""Sanity of a block from its tables alone: figures of its cameras, angles between rays to control, positions."""

from __future__ import annotations

import numpy as np

from aatri.adapters.imported import read_at
from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import OBSERVED_VALUE, Block
from aatri.camera.pixels import half_format_mm, mm_from_pixel
from aatri.errors import InputError
from aatri.frames.checks import place_outside
from aatri.frames.conversion import Frame
from aatri.frames.heights import is_tangent_frame
from aatri.notes import Note
from aatri.observations.control import control_of
from aatri.orientation.plausibility.cameras import Cameras, given_notes
from aatri.orientation.plausibility.control import length
from aatri.orientation.plausibility.control_rays import ControlRays
from aatri.orientation.plausibility.coverage import coverage
from aatri.orientation.plausibility.distances import scale_notes
from aatri.orientation.plausibility.face_angles import contradiction
from aatri.orientation.plausibility.positions import THE_SAME, impossible_positions

LARGE_M = 10e3
"""Larger blocks do not lie in a plane: 2 m over 5 km."""

EARTH_RADIUS_M = 6_371_000.0

PLAIN_LENSES = ("none", "brown", "table")
"""Distortions so small that angles between rays may be taken without them."""


def cameras_of(block: Block) -> Cameras:
    """What the plausibility of a block asks of its cameras."""
    c = block.cameras
    digital = np.asarray(c.kind == "digital")
    pixel = np.where(digital, np.sqrt(c.pixel_size_mm.prod(axis=1)), np.nan)
    half = half_format_mm(digital, c.format, c.pixel_size_mm)
    marks = np.zeros_like(half)
    np.maximum.at(marks, block.fiducials.camera, np.abs(block.fiducials.xy_mm))
    half = np.where(np.isnan(half) & (marks > 0), marks, half)  # the image reaches as far as its marks, at least
    return Cameras(c.id.tolist(), c.principal_distance_mm, half, pixel)


def as_given(block: Block, active: Bool) -> tuple[list[InputError], tuple[Note, ...]]:
    """What positions, control and cameras say against each other, and a line of figures per camera.

    Parameters
    ----------
    block : Block
    active : (n,) bool
        Image points in use.
    """
    rays, observed = _rays(block, active)
    distance = np.linalg.norm(rays.control_m[rays.point] - rays.position_m[rays.image], axis=1)
    of_ray = block.images.camera[rays.image]
    more, away = _distances_by_scale(block, active, of_ray)
    notes = list(given_notes(cameras_of(block), np.concatenate([of_ray, more]), np.concatenate([distance, away])))
    wrong_units, spans = _coverage(block, active)
    if wrong_units:
        return wrong_units, tuple(notes)
    notes += spans
    plain = np.isin(block.cameras.distortion, PLAIN_LENSES)[block.images.camera[rays.image]]
    notes += [*_outside_of_its_system(block), *_plane_frame(block), *_scale_of_distances(block)]
    found = contradiction(_some(rays, plain), observed=observed)
    if found is None:
        return [], tuple(notes)
    images = found.images if len(found.images) else np.unique(rays.image)
    about = block.points.id[control_of(block).point[list(found.points)]] if found.points else block.images.id[images]
    ids = tuple(about.tolist())
    if found.certain:
        where = _place(block, found.of, int(images[0]), int(rays.point[np.argmax(rays.image == images[0])]))
        return [InputError(found.text, where=where, remedy=found.remedy)], tuple(notes)
    notes.append(Note("warning", f"{found.text} ({found.remedy})", ids))
    return [], tuple(notes)


def _coverage(block: Block, active: Bool) -> tuple[list[InputError], list[Note]]:
    """What image points cover, where their place in the image does not hang on interior orientation."""
    xy, known = _photo_mm(block)
    camera = block.images.camera[block.image_points.image]
    plain = (block.cameras.image_coordinates == "photo") | (block.cameras.kind == "digital")
    rows = active & known & plain[camera]
    return coverage(cameras_of(block), camera[rows], xy[rows])


def _distances_by_scale(block: Block, active: Bool, known_camera: Int) -> tuple[Int, Float]:
    """Distances of cameras without positions from the scale of their images: c |X_i - X_j| / |x_i - x_j| of control.

    Of neighbouring control points of each image; vertical images are thought of, others have about the same.
    """
    control, points, c = control_of(block), block.image_points, block.cameras
    number = np.full(len(block.points), -1)
    number[control.point[control.given.all(axis=1)]] = np.flatnonzero(control.given.all(axis=1))
    xy, known = _photo_mm(block)
    rows = np.flatnonzero(active & known & (number[points.point] >= 0))
    rows = rows[np.argsort(points.image[rows], kind="stable")]
    first, second = rows[:-1], rows[1:]
    camera = block.images.camera[points.image[first]]
    use = (points.image[first] == points.image[second]) & ~np.isin(camera, known_camera)
    first, second, camera = first[use], second[use], camera[use]
    apart = np.linalg.norm(xy[second] - xy[first], axis=1)
    X = [control.xyz_m[number[points.point[some]]] for some in (first, second)]
    length_m = np.linalg.norm(X[1] - X[0], axis=1)
    use = apart > 0
    return camera[use], c.principal_distance_mm[camera[use]] * length_m[use] / apart[use]


def _outside_of_its_system(block: Block) -> list[Note]:
    """A warning where coordinates lie far from where their CRS is used: another zone, or axes exchanged."""
    frames = block.frames
    if not len(frames) or frames.crs[0] == "local" or is_tangent_frame(str(frames.crs[0])):
        return []
    frame = Frame(str(frames.id[0]), tuple(str(frames.axes[0]).split(",")), str(frames.crs[0]))
    control = control_of(block)
    xyz = np.vstack([control.xyz_m[control.given.all(axis=1)], block.exterior.position_m])
    outside = place_outside(frame, xyz)
    ask = "check its code, the order of the axes and a zone before the easting"
    return [Note("warning", f"{outside}: {ask}")] if outside else []


def _plane_frame(block: Block) -> list[Note]:
    """A warning for a large block whose frame is taken as Cartesian although it may be a map."""
    crs = str(block.frames.crs[0]) if len(block.frames) else "local"
    if block.earth_curvature != "ignore" or is_tangent_frame(crs):
        return []
    xy = np.concatenate([block.exterior.position_m[:, :2], block.ground_points.xyz_m[:, :2]])
    xy = xy[np.isfinite(xy).all(axis=1)]
    across = float(np.linalg.norm(np.ptp(xy, axis=0))) if len(xy) else 0.0
    if across <= LARGE_M:
        return []
    bend = (across / 2) ** 2 / (2 * EARTH_RADIUS_M)
    return [Note("warning", f"the block is {length(across)} across and `earth_curvature: ignore` takes its frame as "
                 f"Cartesian; if it is a map, heights bend by {length(bend)} from its middle to its ends: declare crs, "
                 "and leave out earth_curvature")]  # fmt: skip


def _scale_of_distances(block: Block) -> list[Note]:
    """A warning where distances between control points of a Cartesian frame have another scale than the coordinates."""
    if len(block.frames) and not (block.frames.crs[0] == "local" or is_tangent_frame(str(block.frames.crs[0]))):
        return []  # the adjustment reduces them
    control, g = control_of(block), block.geodetic
    row_of = {str(block.points.id[p]): k for k, p in enumerate(control.point) if control.given[k].all()}
    rows = [
        k
        for k in np.flatnonzero(g.active & (g.type == "distance") & (g.reduced == "no")).tolist()
        if {str(g.start_kind[k]), str(g.end_kind[k])} == {"point"} and str(g.start[k]) in row_of
        and str(g.end[k]) in row_of and not np.nan_to_num([g.start_height_m[k], g.end_height_m[k]]).any()
    ]  # fmt: skip
    start, end = ([row_of[str(ids[k])] for k in rows] for ids in (g.start, g.end))
    variance = np.trace(control.covariance_m2, axis1=1, axis2=2) / 3
    length_m = np.linalg.norm(control.xyz_m[end] - control.xyz_m[start], axis=1)
    return scale_notes(g.value[rows], length_m, np.sqrt(g.sigma[rows] ** 2 + variance[start] + variance[end]))


def _place(block: Block, of: str, image: int, control: int) -> str:
    """Where to look: the camera, the control point or the position of an image, as far as it is known."""
    if of == "camera":
        return f"camera {block.cameras.id[block.images.camera[image]]}"
    if of == "control":
        return read_at(block, block.ground_points, int(control_of(block).row[control]))
    rows = np.flatnonzero(block.exterior.image == image)
    return read_at(block, block.exterior, int(rows[0])) if len(rows) else ""


def _some(rays: ControlRays, keep: Bool) -> ControlRays:
    return ControlRays(
        rays.image[keep], rays.point[keep], rays.xy_mm[keep], rays.principal_point_mm[keep], rays.c_mm[keep],
        rays.position_m, rays.control_m,
    )  # fmt: skip


def _rays(block: Block, active: Bool) -> tuple[ControlRays, bool]:
    """Rays to control with all coordinates from images with a position; whether most of these are observed."""
    control, points = control_of(block), block.image_points
    number = np.full(len(block.points), -1)
    full = control.given.all(axis=1)
    number[control.point[full]] = np.flatnonzero(full)
    position = np.full((len(block.images), 3), np.nan)
    position[block.exterior.image] = block.exterior.position_m
    xy, known = _photo_mm(block)
    image = points.image
    use = active & known & (number[points.point] >= 0) & np.isfinite(position[image]).all(axis=1)
    rows = np.flatnonzero(use)
    image, camera = image[rows], block.images.camera[image[rows]]
    c = block.cameras
    observed = np.isin(image, block.exterior.image[block.exterior.position_use == OBSERVED_VALUE])
    rays = ControlRays(image, number[points.point[rows]], xy[rows] - c.principal_point_mm[camera],
                c.principal_point_mm[camera], c.principal_distance_mm[camera], position, control.xyz_m)  # fmt: skip
    return rays, bool(observed.mean() > 0.5) if len(rows) else False


def _photo_mm(block: Block) -> tuple[Float, Bool]:
    """Image points in mm from the middle of the image, turned as it may be; whether they can be had."""
    c, points = block.cameras, block.image_points
    xy = np.full((len(points), 2), np.nan)
    camera = block.images.camera[points.image]
    centre, has_centre = _middle_of_marks(block)
    for k in range(len(c)):
        mine = camera == k
        pixel = c.image_coordinates[k] == "pixel"
        if c.image_coordinates[k] == "photo":
            xy[mine] = points.xy[mine]
        elif pixel and c.kind[k] == "digital":
            matrix = mm_from_pixel(c.pixel_size_mm[k], str(c.pixel_origin[k]), str(c.pixel_y[k]), c.format[k])
            xy[mine] = points.xy[mine] @ matrix[:, :2].T + matrix[:, 2]
        else:
            size = c.pixel_size_mm[k] if pixel else 1.0
            xy[mine] = (points.xy[mine] - centre[points.image[mine]]) * size
            xy[mine & ~has_centre[points.image]] = np.nan
    return xy, np.asarray(np.isfinite(xy).all(axis=1))


def _middle_of_marks(block: Block) -> tuple[Float, Bool]:
    """Middle of the fiducial marks of each film image, as measured; with four of them at least."""
    marks, n = block.fiducial_points, len(block.images)
    count = np.bincount(marks.image, minlength=n)
    total = np.stack([np.bincount(marks.image, weights=marks.xy[:, axis], minlength=n) for axis in range(2)], axis=1)
    return total / np.maximum(count, 1)[:, None], np.asarray(count >= 4)


def impossible(block: Block) -> dict[int, str]:
    """Rows of the exterior table whose position cannot be right, with the reason."""
    control = control_of(block)
    heights: Float = control.xyz_m[control.given[:, 2], 2]
    ground = float(np.median(heights)) if len(heights) else block.terrain_height_m
    return impossible_positions(block.exterior.position_m, ground)


def all_the_same(reasons: dict[int, str]) -> bool:
    """Whether positions cannot be because all images have the same one."""
    return all(why.startswith(THE_SAME) for why in reasons.values())


def place_of_position(block: Block, row: int) -> tuple[str, str]:
    """Image and `file:line` of a row of the exterior table."""
    image: Int = block.exterior.image
    return str(block.images.id[image[row]]), read_at(block, block.exterior, row)
