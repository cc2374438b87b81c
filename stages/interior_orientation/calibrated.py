"""Interior orientation by calibration: no fiducial marks, the measured system is known from the camera.

    x = size_x (column - column_0) - x_p,   y = +-size_y (row - row_0) - y_p

(column_0, row_0) is the image centre by the declared pixel origin, the sign is that of the declared direction of y,
(x_p, y_p) the principal point. Photo coordinates, already in mm from the fiducial centre, only lose the principal
point. The transformation is exactly known: its covariance is zero.

Comparator coordinates and scanned film need fiducial marks: interior_orientation/affine.
"""

from __future__ import annotations

import numpy as np

from aatri.arrays import Float, Int
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import FiducialResiduals, ImagePoints
from aatri.artifacts.suspects import Suspects
from aatri.camera.pixels import mm_from_pixel
from aatri.errors import InputError
from aatri.plugin import SILENT, Context, stage

from ._assembly import Transformations, image_points_of


@stage(version=1, uses=("image_points.xy",))
def calibrated(block: Block, *, context: Context = SILENT) -> ImagePoints:
    """Photo coordinates from pixels or given photo coordinates, reduced to the principal point."""
    transformations = calibrated_transformations(block, np.flatnonzero(block.images.active))
    return image_points_of(
        block,
        transformations,
        fiducial_residuals=FiducialResiduals.empty(),
        suspects=Suspects.empty(),
        context=context,
    )


def calibrated_transformations(block: Block, images: Int) -> Transformations:
    """Transformations of the given images by the calibrated pixel size, or none where photo coordinates are given.

    Raises
    ------
    InputError
        If a camera's coordinates cannot be transformed without fiducial marks.
    """
    n = len(block.images)
    matrix = np.full((n, 2, 3), np.nan)
    for camera in np.unique(block.images.camera[images]):
        rows = images[block.images.camera[images] == camera]
        matrix[rows] = _calibrated_matrix(block, int(camera))
    return Transformations(
        model=np.full(n, "calibrated"),
        matrix=matrix,
        covariance=np.zeros((n, 6, 6)),
        sigma0=np.full(n, np.nan),
        redundancy=np.zeros(n, dtype=np.int32),
    )


def _calibrated_matrix(block: Block, camera: int) -> Float:
    cameras = block.cameras
    where = f"camera {cameras.id[camera]}"
    given = cameras.image_coordinates[camera]
    if given == "photo":
        return np.eye(2, 3)
    film = cameras.kind[camera] == "film"
    if given == "comparator" or (film and cameras.pixel_origin[camera] != "image-centre"):
        raise InputError(
            f"{given} coordinates of film have no calibrated relation to the photo system",
            where=where,
            remedy="measure fiducial marks and use interior_orientation/affine",
        )
    try:
        return mm_from_pixel(
            cameras.pixel_size_mm[camera], cameras.pixel_origin[camera], cameras.pixel_y[camera], cameras.format[camera]
        )
    except InputError as error:
        raise InputError(error.what, where=where, remedy=error.remedy) from error
