"""Lens distortion of the cameras of a block."""

from functools import partial

import numpy as np

from aatri.adjustment.threads import by_rows
from aatri.arrays import Float, Int
from aatri.artifacts.block import Block
from aatri.camera.models.distortion import Distortion, corner_points, corrected
from aatri.camera.pixels import half_format_mm
from aatri.errors import AatriError
from aatri.notes import Note

NOT_OF_THE_LENS = ("principal_distance", "principal_point", "symmetry_point", "lever_arm", "boresight")
"""Camera parameters that are not of the distortion model; their components follow a dot."""

LARGE_AT_CORNER = 0.05
"""A distortion above this share of the corner's distance may have been meant the other way round."""


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
    for k in np.unique(camera):
        distortion = distortion_of(block, int(k))
        of_camera = camera == k
        try:
            notes += _checked_corners(block, int(k), distortion)
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
