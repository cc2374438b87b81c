"""Rays and cameras of a Solution as computer vision programs want them: one image coordinate per ray, one camera.

Two ways. Without `image_points` the rays are those measured, and the camera keeps its distortion, which must be one of
the forward models those programs know (none, bal, opencv, fisheye). With `image_points`, the photo coordinates after
interior orientation and image refinement, the rays are free of systematic errors and the camera has no distortion:

    x = projection of the adjusted point - v

so that a ray has what self-calibration found, lens, film and interior orientation of its image, taken off as well, and
the reprojection errors of the exported model are the residuals v. A solution without residuals of image points has the
photo coordinates less what the principal point has moved.

Exported are the image points that are active, belong to an oriented image and a solved point, and were not rejected.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.artifacts.suspects import staying_out
from aatri.camera.models.forward_models import PARAMETERS
from aatri.camera.pixels import half_format_mm, mm_from_pixel
from aatri.errors import GeometryError, InputError
from aatri.geometry.collinearity import in_image_axes, project
from aatri.geometry.vectors import finite_rows

PIXEL_MM = 0.01
"""Pixel of cameras whose pixel size is not known."""

DISTORTION = ("k1", "k2", "k3", "p1", "p2", "b1", "b2")
"""Parameters of the distortions that correct measurements."""

REMEDY = "export with the image points after interior orientation and image refinement"


@dataclass(frozen=True)
class ExportedRays:
    """Exported rays; rows are those of the Block, sorted by image and point.

    Attributes
    ----------
    image, point : (n,) int32
    xy_mm : (n, 2) float64, mm, from the principal point, y up
    """

    image: Int
    point: Int
    xy_mm: Float


@dataclass(frozen=True)
class ExportedCamera:
    """A camera: c and principal point (from the image centre, y up) in mm, size in px, distortion by its names.

    `format_px` is NaN where the image format is not known.
    """

    id: str
    c_mm: float
    principal_point_mm: Float
    pixel_mm: Float
    format_px: Float
    distortion: str
    parameters: dict[str, float]


def exported_rays(solution: Solution, block: Block, image_points: ImagePoints | None = None) -> ExportedRays:
    """The rays of a Solution.

    Raises
    ------
    GeometryError
        If there are none.
    InputError
        If measured coordinates have no known relation to the image centre.
    """
    measured = block.image_points if image_points is None else image_points.measurements
    used = measured.active & solution.images.oriented[measured.image]
    used &= finite_rows(solution.points.xyz_m)[measured.point] & ~_rejected(solution, len(measured))
    if image_points is None:
        xy = np.full((len(measured), 2), np.nan)
        for camera in np.unique(block.images.camera[measured.image[used]]).tolist():
            rows = np.flatnonzero(used & (block.images.camera[measured.image] == camera))
            matrix = _mm_from_measured(block, camera)
            xy[rows] = block.image_points.xy[rows] @ matrix[:, :2].T + matrix[:, 2]
        xy -= solution.cameras.principal_point_mm[block.images.camera[measured.image]]
    else:
        moved = solution.cameras.principal_point_mm - block.cameras.principal_point_mm
        xy = image_points.measurements.xy_mm - moved[block.images.camera[measured.image]]
        corrects_measurements = ~np.isin(block.cameras.distortion, list(PARAMETERS))[block.images.camera]
        _take_as_adjusted(xy, solution, block, image_points, corrects_measurements[measured.image])
    used &= finite_rows(xy)
    if not used.any():
        raise GeometryError("no image point of an oriented image and a solved point", remedy="export a later stage")
    return ExportedRays(measured.image[used], measured.point[used], xy[used])


def _take_as_adjusted(xy_mm: Float, solution: Solution, block: Block, image_points: ImagePoints, of_rays: Bool) -> None:
    """Replace rays that have a residual by the projection of their adjusted point less the residual, in place."""
    table, measured = solution.residuals, image_points.measurements
    adjusted = np.flatnonzero((table.kind == "image_point") & table.active & (table.row >= 0))
    adjusted = adjusted[of_rays[table.row[adjusted]] & finite_rows(table.residual[adjusted, :2])]
    rows = table.row[adjusted]
    image = measured.image[rows]
    u = in_image_axes(
        solution.images.position_m[image],
        solution.images.ground_from_image[image],
        solution.points.xyz_m[measured.point[rows]],
    )
    c_mm = solution.cameras.principal_distance_mm[block.images.camera[image]]
    xy_mm[rows] = project(u, c_mm) - table.residual[adjusted, :2]


def exported_cameras(solution: Solution, block: Block, image_points: ImagePoints | None = None) -> list[ExportedCamera]:
    """The cameras of a Solution, in the order of the Block.

    Raises
    ------
    InputError
        If a distortion is none of the forward models and has not been corrected.
    """
    cameras = block.cameras
    corrected = image_points is not None and "distortion" in image_points.corrections.name.tolist()
    digital = cameras.kind == "digital"
    size = np.where(np.isfinite(cameras.pixel_size_mm), cameras.pixel_size_mm, PIXEL_MM)
    format_px = 2 * half_format_mm(digital, cameras.format, size) / size
    exported = []
    for k, name in enumerate(cameras.id.tolist()):
        model = "none" if corrected or _corrects_nothing(solution, block, k) else str(cameras.distortion[k])
        if model not in ("none", *PARAMETERS):
            what = f"distortion {model} is a correction of the measured coordinates, which no camera here has"
            raise InputError(what, where=f"camera {name}", remedy=REMEDY)
        exported.append(
            ExportedCamera(
                name,
                float(solution.cameras.principal_distance_mm[k]),
                solution.cameras.principal_point_mm[k],
                size[k],
                format_px[k],
                model,
                _parameters(solution, block, k, model),
            )
        )
    return exported


def _corrects_nothing(solution: Solution, block: Block, camera: int) -> bool:
    """Whether a distortion that corrects measurements has no parameter but zeros, as given and as solved."""
    if block.cameras.distortion[camera] not in ("brown", "dbat3"):
        return False
    given, solved = block.camera_parameters, solution.parameters
    mine, of = given.camera == camera, solved.object == block.cameras.id[camera]
    named = zip([*given.name[mine], *solved.name[of]], [*given.value[mine], *solved.value[of]])
    return all(value == 0 for name, value in named if str(name) in DISTORTION)


def _parameters(solution: Solution, block: Block, camera: int, model: str) -> dict[str, float]:
    """Distortion parameters: as solved, else as the Block gives them."""
    names = PARAMETERS.get(model, ())
    given, solved = block.camera_parameters, solution.parameters
    values = dict.fromkeys(names, 0.0)
    rows = given.camera == camera
    values |= {n: v for n, v in zip(given.name[rows].tolist(), given.value[rows].tolist()) if n in values}
    rows = solved.object == block.cameras.id[camera]
    return values | {n: v for n, v in zip(solved.name[rows].tolist(), solved.value[rows].tolist()) if n in values}


def _mm_from_measured(block: Block, camera: int) -> Float:
    cameras = block.cameras
    if cameras.image_coordinates[camera] == "photo":
        return np.eye(2, 3)
    if cameras.image_coordinates[camera] == "comparator" or cameras.kind[camera] == "film":
        what = f"{cameras.image_coordinates[camera]} coordinates of film have no relation to the image centre yet"
        raise InputError(what, where=f"camera {cameras.id[camera]}", remedy=REMEDY)
    return mm_from_pixel(
        cameras.pixel_size_mm[camera], cameras.pixel_origin[camera], cameras.pixel_y[camera], cameras.format[camera]
    )


def _rejected(solution: Solution, n: int) -> Bool:
    rejected = np.zeros(n, dtype=bool)
    table, suspects = solution.residuals, solution.suspects
    rejected[table.row[(table.kind == "image_point") & ~table.active & (table.row >= 0)]] = True
    named = (suspects.kind == "image_point") & staying_out(suspects) & (suspects.row >= 0)
    rejected[suspects.row[named]] = True
    return rejected
