"""Writing of a Solution as a COLMAP sparse model, text or binary; the forms are those of `colmap` and `colmap_model`.

Cameras become PINHOLE (none), RADIAL (bal; OPENCV with two pixel sizes), OPENCV or FULL_OPENCV (opencv), OPENCV_FISHEYE
(fisheye), with SIMPLE_PINHOLE for square pixels without distortion. Points keep their ids where all ids are positive
numbers without leading zeros, else they are numbered from 1; images are numbered from 1 and keep their ids as names.
COLMAP has one image for each pose: images without an orientation and points without a ray are left out, and counted.
The mean reprojection error of each point is that of the written model.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from aatri.arrays import Float, Int, Text
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.camera.models import forward_models
from aatri.errors import ResourceError
from aatri.formats.colmap.binary import binary_paths, write_binary
from aatri.formats.colmap.model import ColmapCamera, ColmapImage, ColmapModel
from aatri.formats.colmap.text import text_paths, write_text
from aatri.formats.conventions.poses import Y_UP, quaternion_of_matrix, stated_rotation, translation_of
from aatri.formats.results.exported_rays import ExportedCamera, ExportedRays, exported_cameras, exported_rays
from aatri.geometry.collinearity import in_image_axes
from aatri.progress import SILENT, Reporter

MARGIN = 1.1
"""Size of an image whose format is not known, as a multiple of what its points need."""


def write_colmap_model(
    solution: Solution,
    block: Block,
    folder: Path,
    *,
    binary: bool = False,
    image_points: ImagePoints | None = None,
    reporter: Reporter = SILENT,
) -> list[Path]:
    """Write a Solution as a sparse model.

    Parameters
    ----------
    solution : Solution
    block : Block
        The Block it belongs to.
    folder : Path
        Made if it is not there.
    binary : bool
    image_points : ImagePoints, optional
        Corrected image points; None: as measured, with the distortion of the cameras.
    reporter : Reporter

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    InputError
        If a camera has no like in COLMAP.
    ResourceError
        If a file cannot be written.
    """
    rays = exported_rays(solution, block, image_points)
    cameras = exported_cameras(solution, block, image_points)
    model = _model(solution, block, rays, cameras, binary_paths(folder) if binary else text_paths(folder))
    left_out = len(block.images) - len(model.images), len(block.points) - len(model.points)
    if any(left_out):
        reporter.log(f"left out: {left_out[0]} images without orientation or rays, {left_out[1]} points without rays")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (write_binary if binary else write_text)(model)
    except OSError as error:
        raise ResourceError(f"cannot write: {error}", where=str(folder), remedy="choose another folder") from error
    return model.paths


def _model(
    solution: Solution, block: Block, rays: ExportedRays, cameras: list[ExportedCamera], paths: list[Path]
) -> ColmapModel:
    images, first = np.unique(rays.image, return_index=True)
    points = np.unique(rays.point)
    names = _point_names(block.points.id[points])
    name_of_row = np.zeros(len(block.points), np.int64)
    name_of_row[points] = names
    camera = block.images.camera
    sizes = [_size(c, rays.xy_mm[camera[rays.image] == k]) for k, c in enumerate(cameras)]
    centre = np.array([size / 2 + c.principal_point_mm * Y_UP[:2] / c.pixel_mm for c, size in zip(cameras, sizes)])
    pixel = np.array([c.pixel_mm for c in cameras])
    ray_camera = camera[rays.image]
    xy_px = centre[ray_camera] + rays.xy_mm * Y_UP[:2] / pixel[ray_camera]
    quaternion, translation = _poses(solution, images)
    parts = zip(np.split(xy_px, first[1:]), np.split(name_of_row[rays.point], first[1:]))
    used = np.unique(camera[images]).tolist()
    error = _errors_px(solution, rays, cameras, ray_camera)
    mean = np.bincount(rays.point, error)[points] / np.bincount(rays.point)[points]
    return ColmapModel(
        cameras=[_camera(k + 1, cameras[k], sizes[k], centre[k]) for k in used],
        images=[
            ColmapImage(n + 1, tuple(q), tuple(t), int(camera[row]) + 1, str(block.images.id[row]), xy, point)
            for n, (row, q, t, (xy, point)) in enumerate(zip(images, quaternion.tolist(), translation.tolist(), parts))
        ],
        points=names,
        xyz=solution.points.xyz_m[points],
        point_lines=np.zeros(len(points), np.int32),
        paths=paths,
        error_px=mean.tolist(),
    )


def _poses(solution: Solution, images: Int) -> tuple[Float, Float]:
    """Quaternions w x y z with w >= 0, and translations."""
    rotation = solution.images.ground_from_image[images]
    quaternion = quaternion_of_matrix(stated_rotation(rotation, "colmap"))
    return quaternion, translation_of(rotation, solution.images.position_m[images], "colmap")


def _size(camera: ExportedCamera, xy_mm: Float) -> Float:
    """Width and height in whole px; where the format is not known, what the points need."""
    if np.isfinite(camera.format_px).all():
        return np.asarray(np.ceil(camera.format_px - 1e-9))
    reach = np.abs(xy_mm + camera.principal_point_mm).max(axis=0, initial=0.0) / camera.pixel_mm
    return np.asarray(np.maximum(2 * np.ceil(MARGIN * reach), 2.0))


def _camera(number: int, camera: ExportedCamera, size: Float, centre: Float) -> ColmapCamera:
    f = (camera.c_mm / camera.pixel_mm).tolist()
    square = abs(f[0] - f[1]) <= 1e-12 * f[0]
    p = camera.parameters
    names: tuple[str, ...] = ("k1", "k2", "p1", "p2")
    model, first = "OPENCV", f
    if camera.distortion == "none":
        model, first, names = ("SIMPLE_PINHOLE", f[:1], ()) if square else ("PINHOLE", f, ())
    elif camera.distortion == "fisheye":
        model, first, names = "OPENCV_FISHEYE", f, ("k1", "k2", "k3", "k4")
    elif camera.distortion == "bal" and square:
        model, first, names = "RADIAL", f[:1], ("k1", "k2")
    elif any(p.get(name, 0.0) for name in ("k3", "k4", "k5", "k6")):
        model, first, names = "FULL_OPENCV", f, ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
    values = (*first, *centre.tolist(), *(p.get(name, 0.0) for name in names))
    return ColmapCamera(number, model, int(size[0]), int(size[1]), values)


def _errors_px(solution: Solution, rays: ExportedRays, cameras: list[ExportedCamera], ray_camera: Int) -> Float:
    """Length of each ray's reprojection error, (n,) px."""
    images = solution.images
    u = in_image_axes(
        images.position_m[rays.image], images.ground_from_image[rays.image], solution.points.xyz_m[rays.point]
    )
    ideal = u[:, :2] * np.array([-1.0, 1.0]) / u[:, 2:]  # v down
    error = np.zeros(len(u))
    for k, camera in enumerate(cameras):
        rows = ray_camera == k
        uv = ideal[rows]
        if camera.distortion != "none":
            uv, _ = forward_models.MODELS[camera.distortion](uv, camera.parameters)
        misfit_mm = uv * camera.c_mm * Y_UP[:2] - rays.xy_mm[rows]
        error[rows] = np.linalg.norm(misfit_mm / camera.pixel_mm, axis=1)
    return error


def _point_names(ids: Text) -> Int:
    """Numbers of points: their ids where all are positive numbers, else from 1."""
    if all(name.isascii() and name.isdigit() and str(int(name)) == name and 0 < int(name) < 2**53 for name in ids):
        return np.array([int(name) for name in ids], dtype=np.int64)
    return np.arange(1, len(ids) + 1, dtype=np.int64)
