"""The fiducial marks of a block as arrays, one row per film image, and back to tables.

Which film images can be used follows from the fit of their marks, and so does what of the marks is suspect.
"""

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from aatri.adapters.solution import stacked, suspect_rows
from aatri.adjustment.statistics.global_test import single_misfits
from aatri.arrays import Bool, Float, Int
from aatri.artifacts.block import Block, Cameras
from aatri.artifacts.image_points import FiducialResiduals, Interior
from aatri.artifacts.suspects import Suspects
from aatri.camera.pixels import mm_from_pixel
from aatri.errors import InputError
from aatri.geometry.plane_transformations import open_basis
from aatri.ids import several
from aatri.orientation.interior.fiducial_fit import FiducialFit, fewest_marks, snooped_fiducials
from aatri.orientation.interior.film_deformation import prediction_sigma_mm, scales_and_shear
from aatri.orientation.interior.mark_tests import is_misfit


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
            where=block.read_at(marked, first),
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


STAGE = "interior_orientation"


def unusable_film(marks: FilmMarks, fit: FiducialFit, max_sigma0: float) -> dict[int, str]:
    """Rows of the marks whose images have no interior orientation, and why.

    Parameters
    ----------
    max_sigma0 : float
        An image whose sigma0 is larger is not used.
    """
    reasons = {k: _reason(marks, fit, k, max_sigma0) for k in range(len(marks.image))}
    return {k: reason for k, reason in reasons.items() if reason}


def _reason(marks: FilmMarks, fit: FiducialFit, k: int, max_sigma0: float) -> str:
    count = int(marks.present[k].sum())
    if count < fewest_marks(fit.model):
        return several(count, "fiducial mark")
    if not fit.determined[k]:
        return f"its fiducial marks are on one line, or determine no {fit.model} transformation"
    used = fit.used[k]
    if is_misfit(fit.residual_mm[k, used], marks.calibrated_mm[k, used]):
        return f"no {fit.model} transformation fits its marks, residual {np.nanmax(np.abs(fit.residual_mm[k])):.2f} mm"
    if fit.sigma0[k] > max_sigma0:
        return f"sigma0 {fit.sigma0[k]:.1f}, beyond max_sigma0 = {max_sigma0:g}"
    return ""


def snooped_marks(marks: FilmMarks, model: str, **limit: float) -> FiducialFit:
    """Transformations of the images onto their marks, those with gross errors left out: `snooped_fiducials`."""
    nominal = np.einsum("nii->ni", marks.nominal)
    return snooped_fiducials(
        model, marks.measured, marks.calibrated_mm, marks.sigma_mm, marks.present, nominal, **limit
    )


def of_usable(fit: FiducialFit, unusable: Collection[int]) -> FiducialFit:
    """The fit without the images, by row of the marks, that cannot be used."""
    return replace(fit, determined=fit.determined & ~np.isin(np.arange(len(fit.determined)), list(unusable)))


def misfits(fit: FiducialFit, usable: Bool) -> Bool:
    """Images whose marks do not fit, at the level 0.05 / count."""
    return single_misfits(np.where(usable, fit.sigma0, np.nan), fit.redundancy)


def film_suspects(block: Block, marks: FilmMarks, fit: FiducialFit) -> Suspects:
    """Marks rejected, images not used, images with a large sigma0."""
    ids = block.images.id[marks.image]
    image, slot = np.nonzero(fit.determined[:, None] & marks.present & ~fit.used)
    rows = marks.row[image, slot]
    size = np.sqrt((fit.residual_mm[image, slot] ** 2).sum(axis=1))
    K = open_basis(fit.model, marks.calibrated_mm[image, slot], fit.photo_from_nominal[image])
    sigma = prediction_sigma_mm(K, fit.covariance[image], marks.sigma_mm[image, slot])
    rejected = suspect_rows(
        STAGE,
        "fiducial",
        row=rows,
        image=ids[image],
        point=block.fiducials.id[block.fiducial_points.fiducial[rows]],
        size=size,
        sigma=sigma,
        test=size / sigma,
    )
    unused, high = ids[~fit.determined], misfits(fit, fit.determined)
    nameless = suspect_rows(STAGE, "fiducial", image=unused, point=np.full(len(unused), ""))
    point, test = np.full(int(high.sum()), ""), fit.sigma0[high]
    kept = suspect_rows(STAGE, "fiducial", image=ids[high], point=point, test=test, verdict="kept")
    return stacked([rejected, nameless, kept])
