"""Image points corrected: for distortion, refraction, earth curvature, in this order, or for anything else.

Refraction and earth curvature go by closed forms or ray by ray. What the block does not tell enough for is left out,
and told with its size: these corrections are micrometres.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from aatri.adapters.limits import LARGE_AT_CORNER
from aatri.adapters.refinement.heights import Stations, stations_of
from aatri.adjustment.threads import by_rows
from aatri.arrays import Bool, Float, Int, finite_rows
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import Corrections, ImagePoints
from aatri.artifacts.solution import Solution
from aatri.camera.corrections.atmosphere import Atmosphere, constant_of
from aatri.camera.corrections.vertical_planes import earth_curvature_correction, refraction_correction
from aatri.camera.limits import FLATTEST_RAD
from aatri.camera.models.distortion import Distortion, corner_points, corrected
from aatri.camera.pixels import half_format_mm
from aatri.errors import AatriError, SpecError
from aatri.geometry.vectors import largest_length
from aatri.ids import several
from aatri.notes import Level, Note

NOT_OF_THE_LENS = ("principal_distance", "principal_point", "symmetry_point", "lever_arm", "boresight")
"""Camera parameters that are not of the distortion model; their components follow a dot."""


def lens_correction(block: Block, image: Int, xy_mm: Float) -> tuple[Float, tuple[Note, ...]]:
    """Correction of lens distortion for points of the given images, mm, (n, 2), and what is to be said of the lenses.

    Raises
    ------
    InputError
        If a camera's distortion is not known or folds inside its format; the camera is named.
    """
    correction = np.zeros_like(xy_mm)
    camera = block.images.camera[image]
    notes: list[Note] = []
    cameras = np.flatnonzero(np.bincount(camera)).tolist()
    for k in cameras:
        distortion = distortion_of(block, k)
        of_camera = slice(None) if len(cameras) == 1 else camera == k
        try:
            notes += _checked_corners(block, k, distortion)
            correction[of_camera] = by_rows(partial(_correction, distortion), xy_mm[of_camera])
        except AatriError as error:
            raise type(error)(error.what, where=f"camera {block.cameras.id[k]}", remedy=error.remedy) from error
    return correction, tuple(notes)


def _correction(distortion: Distortion, xy_mm: Float) -> Float:
    return corrected(distortion, xy_mm) - xy_mm


def distortion_of(block: Block, camera: int) -> Distortion:
    """The lens distortion of a camera as calibrated."""
    cameras, table = block.cameras, block.distortion_table
    rows = table.camera == camera
    order = np.argsort(table.radius_mm[rows], kind="stable")
    x_s, y_s = np.nan_to_num(cameras.symmetry_point_mm[camera])
    return Distortion(
        model=str(cameras.distortion[camera]),
        principal_distance_mm=float(cameras.principal_distance_mm[camera]),
        parameters=_parameters(block, camera),
        symmetry_point_mm=(float(x_s), float(y_s)),
        radius_mm=table.radius_mm[rows][order],
        correction_mm=table.correction_mm[rows][order],
    )


def _parameters(block: Block, camera: int) -> dict[str, float]:
    """Values by name; rows without a value only carry the standard deviation of a parameter."""
    parameters = block.camera_parameters
    rows = np.flatnonzero((parameters.camera == camera) & np.isfinite(parameters.value))
    values = {str(parameters.name[k]): float(parameters.value[k]) for k in rows}
    return {name: value for name, value in values.items() if name.partition(".")[0] not in NOT_OF_THE_LENS}


def _checked_corners(block: Block, camera: int, distortion: Distortion) -> list[Note]:
    """Refuse a distortion that folds inside the format; warn of one that is very large in the corners."""
    one = slice(camera, camera + 1)
    cameras = block.cameras
    half = half_format_mm(cameras.kind[one] == "digital", cameras.format[one], cameras.pixel_size_mm[one])[0]
    if not np.isfinite(half).all():
        return []
    diagonal = corner_points(half) - cameras.principal_point_mm[camera]
    correction = corrected(distortion, diagonal) - diagonal
    share = float(np.sqrt((correction**2).sum(axis=1)).max() / np.sqrt((half**2).sum()))
    if share <= LARGE_AT_CORNER:
        return []
    text = (
        f"camera {cameras.id[camera]}: the {distortion.model} distortion reaches {100 * share:.1f} % in the "
        "corners; brown and table are added to the measured coordinate, the others distort the ideal one: values "
        "of a program with the other reading have the wrong signs here"
    )
    return [Note("warning", text)]


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


IN_ORDER = ("distortion", "refraction", "earth_curvature")


def with_corrections(
    image_points: ImagePoints, xy_mm: Float, names: Sequence[str], largest_mm: Sequence[float]
) -> ImagePoints:
    """The image points at corrected places.

    Parameters
    ----------
    xy_mm : (n, 2) float64, mm
        Corrected coordinates of all measurements.
    names, largest_mm : sequences
        The corrections made, in order, and the largest length of each.
    """
    done = image_points.corrections
    return replace(
        image_points,
        measurements=replace(image_points.measurements, xy_mm=xy_mm),
        corrections=Corrections(
            name=np.concatenate([done.name, np.array(names, dtype=np.str_)]),
            largest_mm=np.concatenate([done.largest_mm, largest_mm]),
        ),
    )


def systematically_corrected(
    block: Block,
    image_points: ImagePoints,
    requested: Sequence[str],
    poses: Solution | None = None,
    atmosphere: Atmosphere = "coefficients",
) -> tuple[ImagePoints, tuple[Note, ...]]:
    """Image points freed from what is wanted of `IN_ORDER`, and what is to be said of it.

    Parameters
    ----------
    poses : Solution, optional
        Orientations: every ray is corrected in its own vertical plane.

    Raises
    ------
    SpecError
        If a correction has been made before.
    InputError
        If a distortion is not known or folds.
    """
    requested, notes = _to_apply(block, image_points, requested)
    m = image_points.measurements
    xy = m.xy_mm.copy()
    finite = finite_rows(xy)
    rows = slice(None) if finite.all() else finite  # which copies nothing
    image = m.image[rows]
    largest, stations = [], None
    for name in requested:
        if name == "distortion":
            correction, more = lens_correction(block, image, xy[rows])
        else:
            if stations is None:
                stations, more = stations_of(block, image_points, poses)
                notes += more
            correction, more = earth_correction(name, block, stations, image, xy[rows], m.sigma_mm[rows], atmosphere)
        notes += more
        xy[rows] += correction
        largest.append(largest_length(correction[m.active[rows]]))
        notes.append(Note("note", f"{name}: at most {1e3 * largest[-1]:.2f} um"))
    return with_corrections(image_points, xy, requested, largest), tuple(notes)


def without_distortion(block: Block, image_points: ImagePoints) -> tuple[ImagePoints, tuple[Note, ...]]:
    """Image points of a central projection, for stages that know no lens; as they are where they have been corrected.

    A calibration leaves the distortion in the image points, for the bundle to find.
    """
    if "distortion" in image_points.corrections.name or (block.cameras.distortion == "none").all():
        return image_points, ()
    corrected, notes = systematically_corrected(block, image_points, ["distortion"], None, "coefficients")
    text = (
        "the image points are not corrected for the distortion of the lens: as the block gives it, it is used here only"
    )
    return corrected, (Note("note", text), *notes)


def _to_apply(block: Block, image_points: ImagePoints, requested: Sequence[str]) -> tuple[list[str], list[Note]]:
    """The corrections to make, in order; those that the block has no use for are left out with a note."""
    names, notes = [name for name in IN_ORDER if name in requested], []
    twice = [name for name in names if name in image_points.corrections.name]
    if twice:
        raise SpecError(
            f"already applied to these image points: {', '.join(twice)}",
            where="image_refinement/systematic",
            remedy=f"switch off here: with: {{{', '.join(f'{name}: false' for name in twice)}}}",
        )
    if "earth_curvature" in names and block.earth_curvature != "correct":
        text = f"earth curvature is not corrected: the block says earth_curvature: {block.earth_curvature}"
        notes.append(Note("note", text))
        names.remove("earth_curvature")
    if "distortion" in names and (block.cameras.distortion == "none").all():
        notes.append(Note("note", "no distortion is corrected: the cameras have none"))
        names.remove("distortion")
    return names, notes
