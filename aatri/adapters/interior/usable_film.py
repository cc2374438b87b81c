"""Which film images can be used, by the fit of their fiducial marks, and what of the marks is suspect."""

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from aatri.adapters.interior.film_marks import FilmMarks
from aatri.adapters.solution import stacked, suspect_rows
from aatri.adjustment.statistics.global_test import single_misfits
from aatri.arrays import Bool
from aatri.artifacts.block import Block
from aatri.artifacts.suspects import Suspects
from aatri.geometry.plane_transformations import open_basis
from aatri.ids import several
from aatri.orientation.interior.fiducial_fit import FiducialFit, fewest_marks, snooped_fiducials
from aatri.orientation.interior.fiducial_numbering import is_misfit
from aatri.orientation.interior.film_deformation import prediction_sigma_mm

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
