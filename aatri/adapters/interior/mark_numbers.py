"""Numbering, mirroring and scale of the fiducial marks of film images, by a similarity of each image.

Film is deformed by some parts in a thousand: marks that are the right ones fit a similarity to far better than 2 % of
their extent, whatever transformation is asked for. Those that do not are tried mirrored, and with their numbers
exchanged; what fits is proposed.
"""

from __future__ import annotations

import numpy as np

from aatri.adapters.imported import read_at
from aatri.adapters.interior.film_marks import FilmMarks
from aatri.arrays import Float
from aatri.artifacts.block import Block
from aatri.errors import InputError
from aatri.orientation.interior.fiducial_fit import FiducialFit, fit_fiducials
from aatri.orientation.interior.fiducial_numbering import is_misfit, renumbering, scale_problem

MIRROR = np.array([1.0, -1.0])


def wrong_marks(block: Block, marks: FilmMarks) -> list[InputError | None]:
    """Per film image what is wrong with its marks as a whole; None where nothing is, or nothing that has a remedy."""
    size = np.einsum("nii->ni", marks.nominal)
    given = (marks.measured, marks.calibrated_mm, marks.sigma_mm, marks.present)
    upright, mirrored = (fit_fiducials("similarity", *given, size * way) for way in (np.ones(2), MIRROR))
    return [_wrong(block, marks, upright, mirrored, k) for k in range(len(marks.image))]


def _wrong(block: Block, marks: FilmMarks, upright: FiducialFit, mirrored: FiducialFit, k: int) -> InputError | None:
    if not upright.determined[k]:
        return None
    present = marks.present[k]
    calibrated = marks.calibrated_mm[k, present]
    rows, marked = marks.row[k, present], block.fiducial_points
    where, image = read_at(block, marked, int(rows[0])), f"image {block.images.id[marks.image[k]]}"
    if not is_misfit(upright.residual_mm[k, present], calibrated):
        scale = scale_problem(upright.photo_from_nominal[k])
        remedy = "check the pixel size and the unit of the fiducial coordinates of the camera"
        return InputError(f"{image}: {scale}", where=where, remedy=remedy) if scale else None
    nominal = marks.measured[k, present] @ marks.nominal[k].T
    names = block.fiducials.id[marked.fiducial[rows]]

    def mapping(way: Float) -> str:
        numbering = renumbering(nominal * way, calibrated)
        return "" if numbering is None else ", ".join(f"{a} is {b}" for a, b in zip(names, names[numbering]) if a != b)

    exchanged, direction = mapping(np.ones(2)), "check pixel: {y: down} or {y: up} of the camera"
    if not is_misfit(mirrored.residual_mm[k, present], calibrated):
        also = f", or exchange numbers: {exchanged}" if exchanged else ""
        return InputError(
            f"{image}: its fiducial marks fit only as a mirror image",
            where=where,
            remedy=f"{direction} (a comparator counts y up){also}",
        )
    if exchanged:
        return InputError(f"{image}: the numbers of its fiducial marks are exchanged", where=where, remedy=exchanged)
    both = mapping(MIRROR)
    if both:
        what = f"{image}: its fiducial marks fit only as a mirror image, and with their numbers exchanged"
        return InputError(what, where=where, remedy=f"{both}; and {direction}")
    return None
