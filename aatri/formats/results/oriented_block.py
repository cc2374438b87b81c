"""A block with its orientation as writers of other programs want it: cameras, poses, points and rays in pixels.

It is a Block with the start values that it has, or a Solution. Image coordinates count from the image centre, x right,
y down, so that a writer adds its origin; cameras are `Lens`, which `lens_conversion` turns into each program's.

Of a Solution there are two ways. Without `image_points` the rays are those measured, and the cameras keep their
distortion. With `image_points`, the photo coordinates after interior orientation and image refinement, the rays are
free of systematic errors and the cameras have no distortion:

    x = projection of the adjusted point - v

so that a ray has what self-calibration found, lens, film and interior orientation of its image, taken off as well, and
the reprojection errors of the exported model are the residuals v. A solution without residuals of image points has the
photo coordinates less what the principal point has moved. Rays are then those that are active, belong to an oriented
image and a solved point, and were not rejected.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from aatri.arrays import Bool, Float, Int, finite_rows
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.camera.models.forward_models import PARAMETERS
from aatri.camera.pixels import half_format_mm, mm_from_pixel
from aatri.errors import GeometryError, InputError
from aatri.formats.conventions.lens import FORMS, Lens
from aatri.geometry.collinearity import in_image_axes, project
from aatri.geometry.rotations import rotation_from_angles
from aatri.observations.poses import ADDITIONAL

PIXEL_MM = 0.01
"""Pixel of cameras whose pixel size is not known."""

MARGIN = 1.1
"""Size of an image whose format is not known, as a multiple of what its points need."""

Y_DOWN = np.array([1.0, -1.0])

REMEDY = "export with the image points after interior orientation and image refinement"


class Rays(NamedTuple):
    """Image points, sorted by image and point: rows of the Block, px from the image centre, x right, y down."""

    image: Int
    point: Int
    xy_px: Float
    sigma_px: Float

    def of_points(self) -> dict[int, list[int]]:
        """Rows of the rays of each point that has any."""
        order = np.argsort(self.point, kind="stable")
        points, first = np.unique(self.point[order], return_index=True)
        return dict(zip(points.tolist(), (rows.tolist() for rows in np.split(order, first[1:]))))


@dataclass(frozen=True, eq=False)
class OrientedBlock:
    """A block with its orientation; all rows are those of the tables of the Block."""

    block: Block
    """As given: names, roles, standard deviations, frame."""
    solution: Solution | None = None
    """Adjusted orientations, points and cameras; None: the start values of the Block."""
    image_points: ImagePoints | None = None
    """Corrected image points of the Solution; None: as measured, with the distortion of the cameras."""

    @cached_property
    def position_m(self) -> Float:
        """Projection centres (n, 3), NaN where not known."""
        if self.solution is not None:
            return self.solution.images.position_m
        position = np.full((len(self.block.images), 3), np.nan)
        position[self.block.exterior.image] = self.block.exterior.position_m
        return position

    @cached_property
    def ground_from_image(self) -> Float:
        """Rotations (n, 3, 3), photogrammetric axes, NaN where not known."""
        if self.solution is not None:
            return self.solution.images.ground_from_image
        e, R = self.block.exterior, np.full((len(self.block.images), 3, 3), np.nan)
        if self.block.rotation != "roll-pitch-heading":  # those of a carrier hang on its mount and boresight
            R[e.image] = rotation_from_angles(e.angles_rad, self.block.rotation)
        return R

    @cached_property
    def xyz_m(self) -> Float:
        """Coordinates of points (p, 3), NaN where not known."""
        if self.solution is not None:
            return self.solution.points.xyz_m
        return self.block.given_m

    @cached_property
    def oriented(self) -> Bool:
        """Images that have position and rotation, (n,)."""
        return np.asarray(finite_rows(self.position_m) & np.isfinite(self.ground_from_image).all(axis=(1, 2)))

    @cached_property
    def pixel_mm(self) -> Float:
        """Pixel size of the cameras (c, 2), mm."""
        size = self.block.cameras.pixel_size_mm
        return np.where(np.isfinite(size), size, PIXEL_MM)

    @cached_property
    def photo_coordinates(self) -> tuple[Float, Bool]:
        """Image coordinates (m, 2), mm from the image centre, y up, row by row, and which of them are rays.

        Raises
        ------
        GeometryError
            If none is left of those of a Solution.
        InputError
            If measured coordinates have no relation to the image centre.
        """
        block, image_points = self.block, self.image_points
        measured = block.image_points if image_points is None else image_points.measurements
        used = measured.active.copy()
        if self.solution is not None:
            used &= self.oriented[measured.image] & finite_rows(self.xyz_m)[measured.point]
            used &= ~_rejected(self.solution, len(measured))
        xy_mm = _measured_mm(block, self.solution, used) if image_points is None else _corrected_mm(self, image_points)
        used &= finite_rows(xy_mm)
        if self.solution is not None and not used.any():
            raise GeometryError("no image point of an oriented image and a solved point", remedy="export a later stage")
        return xy_mm, used

    @cached_property
    def rays(self) -> Rays:
        """The rays of `photo_coordinates`, px from the image centre, y down."""
        xy_mm, used = self.photo_coordinates
        measured = self.block.image_points if self.image_points is None else self.image_points.measurements
        rows = np.flatnonzero(used)
        pixel_mm = self.pixel_mm[self.block.images.camera[measured.image[rows]]]
        xy_px, sigma_px = xy_mm[rows] / pixel_mm * Y_DOWN, measured.sigma_mm[rows] / pixel_mm
        return Rays(measured.image[rows], measured.point[rows], xy_px, sigma_px)

    @cached_property
    def lenses(self) -> list[Lens]:
        """The cameras.

        Raises
        ------
        InputError
            If a distortion has no like elsewhere.
        """
        cameras, pixel_mm, of_rays = self.block.cameras, self.pixel_mm, self.block.images.camera[self.rays.image]
        c_mm, x0_mm = cameras.principal_distance_mm, cameras.principal_point_mm
        if self.solution is not None:
            c_mm, x0_mm = self.solution.cameras.principal_distance_mm, self.solution.cameras.principal_point_mm
        size = np.ceil(2 * half_format_mm(cameras.kind == "digital", cameras.format, pixel_mm) / pixel_mm - 1e-9)
        made = []
        for k, name in enumerate(cameras.id.tolist()):
            if not np.isfinite(size[k]).all():
                reach = np.abs(self.rays.xy_px[of_rays == k]).max(axis=0, initial=0.0)
                size[k] = np.maximum(2 * np.ceil(MARGIN * reach), 2.0)
            form = self._form(k)
            (fx, fy), (x0, y0) = (c_mm[k] / pixel_mm[k]).tolist(), (x0_mm[k] / pixel_mm[k] * Y_DOWN).tolist()
            width, height = size[k].tolist()
            lens = Lens(name, form, (width, height), (fx, fy), (x0, y0), self._parameters(k, form))
            made.append(replace(lens, pixel_mm=float(pixel_mm[k, 0])))
        return made

    @cached_property
    def model_rays(self) -> Rays:
        """Rays of oriented images to points with coordinates: what a sparse model has."""
        rays = self.rays
        usable = self.oriented[rays.image] & finite_rows(self.xyz_m)[rays.point]
        if not usable.any():
            remedy = "export a result, or a source with start values of images and points"
            raise GeometryError("no image point of an oriented image and a point with coordinates", remedy=remedy)
        return Rays(rays.image[usable], rays.point[usable], rays.xy_px[usable], rays.sigma_px[usable])

    def from_corner_px(self, rays: Rays) -> Float:
        """Coordinates of rays (m, 2) from the upper left corner of their images, y down."""
        half = np.array([lens.size_px for lens in self.lenses]) / 2
        return rays.xy_px + half[self.block.images.camera[rays.image]]

    def projected_px(self) -> Float:
        """Where the cameras see the points of the model's rays (m, 2), px from the image centre, y down."""
        rays, xy_px = self.model_rays, np.full_like(self.model_rays.xy_px, np.nan)
        u = in_image_axes(self.position_m[rays.image], self.ground_from_image[rays.image], self.xyz_m[rays.point])
        camera = self.block.images.camera[rays.image]
        for k, lens in enumerate(self.lenses):
            of_camera = camera == k
            xy_px[of_camera] = lens.projected(u[of_camera, :2] * -Y_DOWN / u[of_camera, 2:])
        return xy_px

    def _form(self, camera: int) -> str:
        """The form of the distortion of a camera."""
        model = str(self.block.cameras.distortion[camera])
        if self.image_points is not None and "distortion" in self.image_points.corrections.name.tolist():
            return "none"
        freed = self.image_points is not None and self.solution is not None and len(_adjusted_rays(self.solution)) > 0
        if freed and model not in PARAMETERS:  # by `_take_as_adjusted`
            return "none"
        if model in ("none", *PARAMETERS):
            return model
        if model in ("brown", "dbat3") and not any(self._parameters(camera, "brown").values()):
            return "none"
        if model == "brown" and not self.block.cameras.symmetry_point_mm[camera].any():
            return model
        what = f"distortion {model} corrects the measured coordinates, which no camera elsewhere does"
        raise InputError(what, where=f"camera {self.block.cameras.id[camera]}", remedy=REMEDY)

    def _parameters(self, camera: int, form: str) -> dict[str, float]:
        """Distortion parameters: as solved, else as the Block gives them."""
        values = dict.fromkeys(FORMS[form].terms, 0.0)
        stated = self.block.camera_parameters
        rows = stated.camera == camera
        values |= {n: v for n, v in zip(stated.name[rows].tolist(), stated.value[rows].tolist()) if n in values}
        if self.solution is not None:
            solved = self.solution.parameters
            rows = solved.object == self.block.cameras.id[camera]
            values |= {n: v for n, v in zip(solved.name[rows].tolist(), solved.value[rows].tolist()) if n in values}
        return values


def _corrected_mm(oriented: OrientedBlock, image_points: ImagePoints) -> Float:
    """Corrected image coordinates in mm from the image centre, y up, (m, 2)."""
    solution, block = oriented.solution, oriented.block
    if solution is None:
        raise ValueError("corrected image points belong to a Solution")
    camera = block.images.camera[image_points.measurements.image]
    principal_point = solution.cameras.principal_point_mm
    xy_mm = image_points.measurements.xy_mm - (principal_point - block.cameras.principal_point_mm)[camera]
    corrects_measurements = ~np.isin(block.cameras.distortion, list(PARAMETERS))[camera]
    _take_as_adjusted(xy_mm, solution, block, image_points, corrects_measurements)
    return np.asarray(xy_mm + principal_point[camera])


def _adjusted_rays(solution: Solution) -> Int:
    """Rows of the residuals of image points that were adjusted."""
    table = solution.residuals
    return np.asarray(np.flatnonzero((table.kind == "image_point") & table.active & (table.row >= 0)))


def _take_as_adjusted(xy_mm: Float, solution: Solution, block: Block, image_points: ImagePoints, of_rays: Bool) -> None:
    """Replace rays that have a residual by the projection of their adjusted point less the residual, in place."""
    table, measured = solution.residuals, image_points.measurements
    adjusted = _adjusted_rays(solution)
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


def _measured_mm(block: Block, solution: Solution | None, used: Bool) -> Float:
    """Measured image coordinates in mm from the image centre, y up, (m, 2); NaN of cameras that none is used of.

    Raises
    ------
    InputError
        If they have no known relation to the image centre, or cameras cannot state what corrects them.
    """
    rows = block.image_points
    if solution is not None and (solution.parameters.group == ADDITIONAL).any():
        what = "self-calibration found additional parameters, which measured image points do not have taken off"
        raise InputError(what, where=f"block {block.name}", remedy=REMEDY)
    xy_mm, camera = np.full((len(rows), 2), np.nan), block.images.camera[rows.image]
    for k in np.unique(camera[used]).tolist():
        matrix = _mm_from_measured(block, k)
        xy_mm[camera == k] = rows.xy[camera == k] @ matrix[:, :2].T + matrix[:, 2]
    return xy_mm


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
    named = (suspects.kind == "image_point") & suspects.staying_out & (suspects.row >= 0)
    rejected[suspects.row[named]] = True
    return rejected
