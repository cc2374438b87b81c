"""Checks of the fiducial marks of film images, and what is to be said of them.

sigma0 of the images is tested pooled, and single images that do not fit are listed (`statistics.global_test`); an image
whose sigma0 is beyond `max_sigma0` is not used.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from aatri.adapters.interior.film_marks import FilmMarks
from aatri.adapters.interior.mark_numbers import wrong_marks
from aatri.adapters.solution import stacked, suspect_rows
from aatri.adjustment.statistics.global_test import pooled_test, sigma0_note, single_misfits
from aatri.arrays import Bool, Float
from aatri.artifacts.block import Block
from aatri.artifacts.suspects import Suspects
from aatri.errors import AatriError, GeometryError, raise_all
from aatri.geometry.plane_transformations import open_basis
from aatri.ids import shown
from aatri.notes import Note
from aatri.orientation.interior.fiducial_fit import FiducialFit, fewest_marks, fit_fiducials, snooped_fiducials
from aatri.orientation.interior.fiducial_numbering import is_misfit
from aatri.orientation.interior.film_deformation import (
    prediction_sigma_mm,
    scales_and_shear,
    shear_or_stretch,
    turn_rad,
)

STAGE = "interior_orientation"

MOST_REJECTED = 0.05
"""More film images than this share without interior orientation are an error."""

TOO_SIMPLE = 1.5
"""A similarity whose sigma0 is so many times that of an affine transformation leaves out what the film has done."""

LARGEST_SHEAR = 1e-3
"""Affine deformation of film beyond this is unusual."""


def check_film(block: Block, marks: FilmMarks, fit: FiducialFit, max_sigma0: float) -> tuple[Bool, tuple[Note, ...]]:
    """Which film images can be used, and what is to be said of them.

    Parameters
    ----------
    max_sigma0 : float
        An image whose sigma0 is larger is not used.

    Raises
    ------
    InputError
        If marks have exchanged numbers, are mirrored or of a wrong scale.
    GeometryError
        If more than 5 % of the film images have no interior orientation.
    """
    usable = fit.determined.copy()
    errors: list[AatriError] = [wrong for wrong in wrong_marks(block, marks) if wrong is not None]
    raise_all(errors)
    reasons = []
    for k, image in enumerate(marks.image):
        reason = _reason_to_reject(marks, fit, k, max_sigma0)
        if reason:
            usable[k] = False
            reasons.append(f"{block.images.id[image]} ({reason})")
    if len(reasons) > MOST_REJECTED * len(usable):
        fewest = fewest_marks(fit.model)
        simple = [note.text for note in _too_simple(marks)] if fit.model == "similarity" else []
        raise GeometryError(
            f"{len(reasons)} of {len(usable)} film images have no interior orientation: {shown(reasons)}",
            remedy=simple[0]
            if simple
            else f"a transformation that is {fit.model} needs at least {fewest} fiducial marks in every film image, "
            f"{fewest + 1} to check them, well spread; or take a variant of interior_orientation with fewer parameters",
        )
    return usable, tuple(_notes(block, marks, fit, usable, reasons))


def _reason_to_reject(marks: FilmMarks, fit: FiducialFit, k: int, max_sigma0: float) -> str:
    count = int(marks.present[k].sum())
    if count < fewest_marks(fit.model):
        return f"{count} fiducial marks"
    if not fit.determined[k]:
        return f"its fiducial marks are on one line, or determine no {fit.model} transformation"
    used = fit.used[k]
    if is_misfit(fit.residual_mm[k, used], marks.calibrated_mm[k, used]):
        return f"no {fit.model} transformation fits its marks, residual {np.nanmax(np.abs(fit.residual_mm[k])):.2f} mm"
    if fit.sigma0[k] > max_sigma0:
        return f"sigma0 {fit.sigma0[k]:.1f}, beyond max_sigma0 = {max_sigma0:g}"
    return ""


def misfits(fit: FiducialFit, usable: Bool) -> Bool:
    """Images whose marks do not fit, at the level 0.05 / count."""
    return single_misfits(np.where(usable, fit.sigma0, np.nan), fit.redundancy)


def _notes(block: Block, marks: FilmMarks, fit: FiducialFit, usable: Bool, reasons: list[str]) -> Iterator[Note]:
    ids = block.images.id[marks.image]
    if reasons:
        yield Note("warning", f"{len(reasons)} film images are not used, without interior orientation", tuple(reasons))
    if usable.any():
        yield sigma0_note(
            pooled_test(fit.sigma0[usable], fit.redundancy[usable]), f"of {int(usable.sum())} film images"
        )
    exact = usable & (fit.redundancy == 0)
    if exact.any():
        count = ("no", "one", "two", "three", "four")[fewest_marks(fit.model)]
        yield Note("warning", f"only {count} fiducial marks, no check of their measurement", tuple(ids[exact].tolist()))
    high = misfits(fit, usable)
    if high.any():
        told = tuple(f"{i} ({s:.1f})" for i, s in zip(ids[high], fit.sigma0[high]))
        yield Note("warning", "sigma0 of single images is too large, a mark may be wrong", told)
    rejected = usable[:, None] & marks.present & ~fit.used
    if rejected.any():
        names = block.fiducials.id[block.fiducial_points.fiducial[marks.row[rejected]]]
        told = tuple(f"{i}/{m}" for i, m in zip(ids[np.nonzero(rejected)[0]], names))
        yield Note("warning", f"{len(told)} fiducial marks are rejected", told)
    if fit.model == "similarity" and (high.any() or rejected.any()):
        yield from _too_simple(marks)
    linear = fit.photo_from_nominal
    if usable.any():
        yield _film_note(linear[usable])
    skewed = usable & (shear_or_stretch(linear) > LARGEST_SHEAR)
    if skewed.any():
        text = "film deformed by more than 1e-3 (shear or unequal scales)"
        yield Note("warning", text, tuple(ids[skewed].tolist()))
    yield from _turned_scans(block, marks, linear, usable)


def _too_simple(marks: FilmMarks) -> Iterator[Note]:
    """Where an affine transformation fits the same marks and a similarity does not, the marks are not to blame."""
    data, size = (marks.measured, marks.calibrated_mm, marks.sigma_mm), np.einsum("nii->ni", marks.nominal)
    affine = snooped_fiducials("affine", *data, marks.present, size)
    simple = fit_fiducials("similarity", *data, affine.used, size)
    of_affine, of_simple = (pooled_test(fit.sigma0, fit.redundancy) for fit in (affine, simple))
    if of_simple.sigma0 > of_simple.high and of_simple.sigma0 > TOO_SIMPLE * of_affine.sigma0:
        text = f"a similarity is too simple for this film: sigma0 {of_simple.sigma0:.2f}, an affine transformation of "
        text += f"the same marks has {of_affine.sigma0:.2f}; not the marks are wrong: use interior_orientation/affine"
        yield Note("warning", text)


def _film_note(linear: Float) -> Note:
    scale, shear = scales_and_shear(linear)
    (x0, y0), (x1, y1) = scale.min(axis=0), scale.max(axis=0)
    seconds = np.rad2deg(np.abs(shear).max()) * 3600
    text = f"film: scale in x {x0:.6f} to {x1:.6f}, in y {y0:.6f} to {y1:.6f}, shear up to {seconds:.1f} seconds of arc"
    return Note("note", text)


def _turned_scans(block: Block, marks: FilmMarks, linear: Float, usable: Bool) -> Iterator[Note]:
    """A few scans turned by a right angle against the rest may be marks numbered from another corner."""
    angle = turn_rad(linear)
    quarter = np.rint(np.where(usable, angle, 0.0) / (np.pi / 2)).astype(np.int64) % 4
    camera = block.images.camera[marks.image]
    for one in np.unique(camera[usable]):
        mine = usable & (camera == one)
        usual = int(np.bincount(quarter[mine], minlength=4).argmax())
        turned = mine & (quarter != usual)
        if turned.any():
            text = (
                f"turned by right angles against the other images of camera {block.cameras.id[one]}, check that "
                "the fiducial marks are numbered from the same corner"
            )
            yield Note("warning", text, tuple(block.images.id[marks.image[turned]].tolist()))


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
