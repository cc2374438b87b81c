"""Writing of an oriented block as a COLMAP sparse model; the forms are those of `text`.

Cameras become SIMPLE_PINHOLE or PINHOLE (none), RADIAL (bal; OPENCV with two pixel sizes), OPENCV or FULL_OPENCV
(opencv), OPENCV_FISHEYE (fisheye); a brown distortion is fitted by FULL_OPENCV. Points keep their ids where all ids are
positive numbers without leading zeros, else they are numbered from 1; images are numbered from 1 and keep their ids as
names. COLMAP has one image for each pose: images without an orientation and points without a ray are left out, and
counted. The mean reprojection error of each point is that of the block.
"""

from pathlib import Path

import numpy as np

from aatri.arrays import Int, Text
from aatri.formats.colmap.model import ColmapCamera, ColmapImage, ColmapModel
from aatri.formats.colmap.text import texts_of
from aatri.formats.conventions.lens import FORMS, Lens
from aatri.formats.conventions.lens_conversion import as_program_states
from aatri.formats.conventions.poses import quaternion_of_matrix, stated_rotation, translation_of
from aatri.formats.parts.format import AS_USUAL, Writing
from aatri.formats.results.oriented_block import OrientedBlock
from aatri.formats.text.written_files import write_files
from aatri.ids import several
from aatri.progress import SILENT, Reporter

MODELS = {
    "none": ("SIMPLE_PINHOLE", "PINHOLE"),
    "bal": ("RADIAL", "OPENCV"),
    "opencv": ("OPENCV", "FULL_OPENCV"),
    "fisheye": ("OPENCV_FISHEYE",),
    "brown": ("FULL_OPENCV",),
}
"""Camera models that a distortion of ours becomes, the first that has a place for it."""


def write_colmap_model(
    oriented: OrientedBlock, folder: Path, writing: Writing = AS_USUAL, reporter: Reporter = SILENT
) -> None:
    """Write an oriented block as a sparse model.

    Parameters
    ----------
    folder : Path
        Made if it is not there.
    """
    write_files(folder, texts_of(colmap_model(oriented, writing, reporter)))


def colmap_model(oriented: OrientedBlock, writing: Writing, reporter: Reporter) -> ColmapModel:
    """The sparse model of an oriented block; what has no place in it is told."""
    block, cameras = oriented.block, oriented.block.images.camera
    used = np.unique(cameras[oriented.model_rays.image]).tolist()
    lenses = {
        k: as_program_states(
            lens, [f"colmap-{name}" for name in MODELS[lens.form]], reporter, allowed_px=writing.lens_misfit_px
        )
        for k, lens in enumerate(oriented.lenses)
        if k in used
    }
    model = _model(oriented, lenses)
    left_out = len(block.images) - len(model.images), len(block.points) - len(model.points)
    if any(left_out):
        images, points = several(left_out[0], "image"), several(left_out[1], "point")
        reporter.log(f"left out: {images} without orientation or rays, {points} without rays")
    return model


def _model(oriented: OrientedBlock, lenses: dict[int, Lens]) -> ColmapModel:
    block, rays = oriented.block, oriented.model_rays
    images, first = np.unique(rays.image, return_index=True)
    points = np.unique(rays.point)
    names = _point_names(block.points.id[points])
    name_of_row = np.zeros(len(block.points), np.int64)
    name_of_row[points] = names
    camera = block.images.camera
    xy_px = oriented.from_corner_px(rays)
    rotation = oriented.ground_from_image[images]
    quaternion = quaternion_of_matrix(stated_rotation(rotation, "colmap"))
    translation = translation_of(rotation, oriented.position_m[images], "colmap")
    parts = zip(np.split(xy_px, first[1:]), np.split(name_of_row[rays.point], first[1:]))
    error = np.linalg.norm(oriented.projected_px() - rays.xy_px, axis=1)
    mean = np.bincount(rays.point, error)[points] / np.bincount(rays.point)[points]
    return ColmapModel(
        cameras=[_camera(k + 1, lens) for k, lens in lenses.items()],
        images=[
            ColmapImage(n + 1, tuple(q), tuple(t), int(camera[row]) + 1, str(block.images.id[row]), xy, point)
            for n, (row, q, t, (xy, point)) in enumerate(zip(images, quaternion.tolist(), translation.tolist(), parts))
        ],
        points=names,
        xyz=oriented.xyz_m[points],
        point_lines=np.zeros(len(points), np.int32),
        paths=[],
        error_px=mean.tolist(),
    )


def _camera(number: int, lens: Lens) -> ColmapCamera:
    form = FORMS[lens.form]
    (width, height), (x, y) = lens.size_px, lens.principal_point_px
    focal = lens.focal_px[: form.focal_lengths]
    values = (*focal, width / 2 + x, height / 2 + y, *(lens.parameters.get(name, 0.0) for name in form.terms))
    return ColmapCamera(number, lens.form.removeprefix("colmap-"), int(width), int(height), values)


def _point_names(ids: Text) -> Int:
    """Numbers of points: their ids where all are positive numbers, else from 1."""
    if all(name.isascii() and name.isdigit() and str(int(name)) == name and 0 < int(name) < 2**53 for name in ids):
        return np.array([int(name) for name in ids], dtype=np.int64)
    return np.arange(1, len(ids) + 1, dtype=np.int64)
