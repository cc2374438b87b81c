"""The fiducial marks of a block as arrays, one row per film image, and back to tables."""

from dataclasses import dataclass

import numpy as np

from aatri.adapters.imported import read_at
from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import Block, Cameras
from aatri.artifacts.image_points import FiducialResiduals, Interior
from aatri.camera.pixels import mm_from_pixel
from aatri.errors import InputError
from aatri.orientation.interior.fiducial_fit import FiducialFit
from aatri.orientation.interior.film_deformation import scales_and_shear


@dataclass(frozen=True)
class FilmMarks:
    """Measured marks of n film images, up to m each."""

    image: Int
    """(n,) int64. Row in the Block's images."""
    row: Int
    """(n, m) int64. Row in the Block's fiducial_points; -1 for padding."""
    measured: Float
    """(n, m, 2), mm or px."""
    calibrated_mm: Float
    sigma_mm: Float
    """(n, m, 2), mm."""
    present: Bool
    """(n, m)."""
    nominal: Float
    """(n, 2, 2), mm per unit. To millimetres, x right, y up, by the nominal pixel size."""


def film_images(block: Block) -> Bool:
    """Active images of film cameras whose coordinates need fiducial marks."""
    cameras = block.cameras
    needs = (cameras.kind == "film") & (cameras.image_coordinates != "photo")
    return np.asarray(block.images.active & needs[block.images.camera])


def film_marks(block: Block, images: Int) -> FilmMarks:
    """The marks of the given images, in the order of the Block.

    Raises
    ------
    InputError
        If a standard deviation is not positive.
    """
    marked = block.fiducial_points
    if not (marked.sigma_mm > 0).all():
        first = int(np.flatnonzero(~(marked.sigma_mm > 0).all(axis=1))[0])
        raise InputError(
            f"standard deviation of a fiducial mark of image {block.images.id[marked.image[first]]} is not positive",
            where=read_at(block, marked, first),
            remedy="give sx and sy, or sigma: {fiducial: um} in block.yaml",
        )
    order = np.argsort(marked.image, kind="stable")
    counts = np.bincount(marked.image, minlength=len(block.images))
    starts = np.concatenate([[0], np.cumsum(counts)])
    width = int(counts[images].max(initial=1))
    slot = np.arange(max(width, 1))
    present = slot < counts[images][:, None]
    row = np.full(present.shape, -1, dtype=np.int64)
    row[present] = order[(starts[images][:, None] + slot)[present]]

    def padded(values: Float) -> Float:
        out = np.full((*present.shape, 2), np.nan)
        out[present] = values[row[present]]
        return out

    calibrated = block.fiducials.xy_mm[marked.fiducial]
    nominal = np.array([nominal_matrix(block, int(k)) for k in block.images.camera[images]]).reshape(-1, 2, 2)
    return FilmMarks(images, row, padded(marked.xy), padded(calibrated), padded(marked.sigma_mm), present, nominal)


def nominal_matrix(block: Block, camera: int) -> Float:
    """Linear part of the measured system of a film camera: to mm, x right, y up, (2, 2)."""
    if block.cameras.image_coordinates[camera] != "pixel":
        return np.eye(2)
    return pixel_matrix(block.cameras, camera, "image-centre", np.ones(2))[:, :2]


def pixel_matrix(cameras: Cameras, camera: int, origin: str, format_px: Float) -> Float:
    """Matrix (2, 3) from pixels of a camera, counted from an origin, to mm from the image centre.

    Raises
    ------
    InputError
        If the camera does not say what it takes.
    """
    try:
        return mm_from_pixel(cameras.pixel_size_mm[camera], origin, cameras.pixel_y[camera], format_px)
    except InputError as error:
        raise InputError(error.what, where=f"camera {cameras.id[camera]}", remedy=error.remedy) from error


def film_interior(marks: FilmMarks, fit: FiducialFit) -> Interior:
    """Interior orientation of the film images that have one."""
    good = fit.determined
    scale, shear = scales_and_shear(fit.photo_from_nominal[good])
    of_fit = {name: getattr(fit, name)[good] for name in ("matrix", "terms", "covariance", "sigma0", "redundancy")}
    return Interior.of(image=marks.image[good], model=fit.model, film_scale=scale, film_shear_rad=shear, **of_fit)


def film_residuals(block: Block, marks: FilmMarks, fit: FiducialFit) -> FiducialResiduals:
    """Residuals of the marks of images with redundancy: without it they are zero by construction and say nothing."""
    shown = marks.present & (fit.determined & (fit.redundancy > 0))[:, None]
    rows, marked = marks.row[shown], block.fiducial_points
    ids = block.fiducials.id[marked.fiducial[rows]]
    return FiducialResiduals(rows, marked.image[rows], ids, fit.residual_mm[shown], fit.used[shown])
