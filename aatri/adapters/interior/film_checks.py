"""Checks of the fiducial marks of film images, and what is to be said of them.

sigma0 of the images is tested pooled, and single images that do not fit are listed (`statistics.global_test`); an image
whose sigma0 is beyond `max_sigma0` is not used.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from aatri.adapters.imported import read_at
from aatri.adapters.interior.film_marks import FilmMarks, nominal_matrix
from aatri.adapters.interior.photo_coordinates import Transformations
from aatri.adapters.interior.suspects import joined, suspects_of
from aatri.adjustment.statistics.global_test import pooled_test, sigma0_note, single_misfits
from aatri.arrays import Bool, Float
from aatri.artifacts.block import Block
from aatri.artifacts.suspects import Suspects
from aatri.errors import AatriError, GeometryError, InputError, raise_all
from aatri.ids import shown
from aatri.notes import Note
from aatri.orientation.interior.affine import FEWEST_MARKS, AffineFit
from aatri.orientation.interior.fiducial_numbering import is_mirrored, is_misfit, renumbering, scale_problem
from aatri.orientation.interior.film_deformation import deformation, prediction_sigma_mm, shear_or_stretch, turn_rad

MOST_REJECTED = 0.05
"""More film images than this share without interior orientation are an error."""

LARGEST_SHEAR = 1e-3
"""Affine deformation of film beyond this is unusual."""


def check_film(block: Block, marks: FilmMarks, fit: AffineFit, max_sigma0: float) -> tuple[Bool, tuple[Note, ...]]:
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
    errors: list[AatriError] = []
    reasons = []
    for k, image in enumerate(marks.image):
        wrong = _wrong_marks(block, marks, fit, k) if usable[k] else None
        if wrong is not None:
            errors.append(wrong)
        reason = "" if wrong is not None else _reason_to_reject(marks, fit, k, max_sigma0)
        if reason:
            usable[k] = False
            reasons.append(f"{block.images.id[image]} ({reason})")
    raise_all(errors)
    if len(reasons) > MOST_REJECTED * len(usable):
        raise GeometryError(
            f"{len(reasons)} of {len(usable)} film images have no interior orientation: {shown(reasons)}",
            remedy="measure at least three fiducial marks, not on one line, in every film image; four to check them",
        )
    return usable, tuple(_notes(block, marks, fit, usable, reasons))


def _wrong_marks(block: Block, marks: FilmMarks, fit: AffineFit, k: int) -> InputError | None:
    """Numbering, mirroring or scale of the marks of one image, if wrong."""
    present = marks.present[k]
    calibrated = marks.calibrated_mm[k, present]
    nominal = marks.measured[k, present] @ marks.nominal[k].T
    from_nominal = fit.matrix[k, :, :2] @ np.linalg.inv(marks.nominal[k])
    misfit, mirrored = is_misfit(fit.residual_mm[k, present], calibrated), is_mirrored(from_nominal)
    scale = "" if misfit else scale_problem(from_nominal)
    rows = marks.row[k, present]
    marked = block.fiducial_points
    where = read_at(block, marked, int(rows[0]))
    image = f"image {block.images.id[marks.image[k]]}"
    if scale:
        return InputError(
            f"{image}: {scale}",
            where=where,
            remedy="check the pixel size and the unit of the fiducial coordinates of the camera",
        )
    if not (misfit or mirrored):
        return None
    numbering = renumbering(nominal, calibrated)
    names = block.fiducials.id[marked.fiducial[rows]]
    mapping = "" if numbering is None else ", ".join(f"{a} is {b}" for a, b in zip(names, names[numbering]) if a != b)
    if mirrored and not misfit:
        also = f", or exchange numbers: {mapping}" if mapping else ""
        return InputError(
            f"{image}: its fiducial marks fit only as a mirror image",
            where=where,
            remedy=f"check pixel: {{y: down}} or {{y: up}} of the camera (a comparator counts y up){also}",
        )
    if not mapping:
        return None
    return InputError(f"{image}: the numbers of its fiducial marks are exchanged", where=where, remedy=mapping)


def _reason_to_reject(marks: FilmMarks, fit: AffineFit, k: int, max_sigma0: float) -> str:
    count = int(marks.present[k].sum())
    if count < FEWEST_MARKS:
        return f"{count} fiducial marks"
    if not fit.determined[k]:
        return "fiducial marks on one line"
    used = fit.used[k]
    if is_misfit(fit.residual_mm[k, used], marks.calibrated_mm[k, used]):
        return f"no affine transformation fits its marks, residual {np.nanmax(np.abs(fit.residual_mm[k])):.2f} mm"
    if fit.sigma0[k] > max_sigma0:
        return f"sigma0 {fit.sigma0[k]:.1f}, beyond max_sigma0 = {max_sigma0:g}"
    return ""


def misfits(fit: AffineFit, usable: Bool) -> Bool:
    """Images whose marks do not fit, at the level 0.05 / count."""
    return single_misfits(np.where(usable, fit.sigma0, np.nan), fit.redundancy)


def _notes(block: Block, marks: FilmMarks, fit: AffineFit, usable: Bool, reasons: list[str]) -> Iterator[Note]:
    ids = block.images.id[marks.image]
    if reasons:
        yield Note("warning", f"{len(reasons)} film images are not used, without interior orientation", tuple(reasons))
    if usable.any():
        yield sigma0_note(
            pooled_test(fit.sigma0[usable], fit.redundancy[usable]), f"of {int(usable.sum())} film images"
        )
    exact = usable & (fit.redundancy == 0)
    if exact.any():
        yield Note("warning", "only three fiducial marks, no check of their measurement", tuple(ids[exact].tolist()))
    high = misfits(fit, usable)
    if high.any():
        told = tuple(f"{i} ({s:.1f})" for i, s in zip(ids[high], fit.sigma0[high]))
        yield Note("warning", "sigma0 of single images is too large, a mark may be wrong", told)
    rejected = usable[:, None] & marks.present & ~fit.used
    if rejected.any():
        names = block.fiducials.id[block.fiducial_points.fiducial[marks.row[rejected]]]
        told = tuple(f"{i}/{m}" for i, m in zip(ids[np.nonzero(rejected)[0]], names))
        yield Note("warning", f"{len(told)} fiducial marks are rejected", told)
    linear = fit.matrix[:, :, :2] @ np.linalg.inv(marks.nominal)
    skewed = usable & (shear_or_stretch(linear) > LARGEST_SHEAR)
    if skewed.any():
        text = "film deformed by more than 1e-3 (shear or unequal scales)"
        yield Note("warning", text, tuple(ids[skewed].tolist()))
    yield from _turned_scans(block, marks, linear, usable)


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
            text = (f"turned by right angles against the other images of camera {block.cameras.id[one]}, check that "
                    "the fiducial marks are numbered from the same corner")  # fmt: skip
            yield Note("warning", text, tuple(block.images.id[marks.image[turned]].tolist()))


def film_suspects(block: Block, marks: FilmMarks, fit: AffineFit) -> Suspects:
    """Marks rejected, images not used, images with a large sigma0."""
    ids = block.images.id[marks.image]
    image, slot = np.nonzero(fit.determined[:, None] & marks.present & ~fit.used)
    rows = marks.row[image, slot]
    size = np.sqrt((fit.residual_mm[image, slot] ** 2).sum(axis=1))
    sigma = prediction_sigma_mm(fit.covariance[image], marks.calibrated_mm[image, slot], marks.sigma_mm[image, slot])
    rejected = suspects_of(
        kind="fiducial",
        row=rows,
        image=ids[image],
        point=block.fiducials.id[block.fiducial_points.fiducial[rows]],
        size=size,
        sigma=sigma,
        test=size / sigma,
        verdict="rejected",
    )
    unused = ids[~fit.determined]
    high = misfits(fit, fit.determined)
    return joined(
        rejected,
        suspects_of(kind="fiducial", row=-1, image=unused, point=np.full(len(unused), ""), verdict="rejected"),
        suspects_of(
            kind="fiducial", row=-1, image=ids[high], point=np.full(int(high.sum()), ""), test=fit.sigma0[high],
            verdict="kept",
        ),
    )  # fmt: skip


def film_deformation(block: Block, transformations: Transformations) -> Float:
    """Per image the matrix that gives the film deformation at a photo coordinate, about the fiducial centre.

    Photo coordinates by the affine transformation minus those by its rotation and the nominal scale alone.

    Returns
    -------
    (n, 2, 2) float64
    """
    change = np.zeros((len(block.images), 2, 2))
    film = np.flatnonzero((transformations.model == "affine") & np.isfinite(transformations.matrix).all(axis=(1, 2)))
    if len(film):
        nominal = np.array([nominal_matrix(block, int(k)) for k in block.images.camera[film]])
        change[film] = deformation(transformations.matrix[film, :, :2] @ np.linalg.inv(nominal))
    return change
