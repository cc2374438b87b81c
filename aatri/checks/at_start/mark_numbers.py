"""Numbering, mirroring and scale of the fiducial marks of film images, by a similarity of each image.

Film is deformed by some parts in a thousand: marks that are the right ones fit a similarity to far better than 2 % of
their extent, whatever transformation is asked for.

Seen: marks whose numbers are exchanged, that are mirrored, or measured in another unit.
Test: marks that fit no similarity are tried mirrored, and with their numbers exchanged; what fits is proposed.
"""

import numpy as np

from aatri.adapters.interior.film_marks import FilmMarks
from aatri.arrays import Float
from aatri.artifacts.block import Block
from aatri.checks.finding import Finding
from aatri.ids import shown
from aatri.orientation.interior.fiducial_fit import FiducialFit, fit_fiducials
from aatri.orientation.interior.mark_tests import is_misfit, renumbering, scale_problem

MIRROR = np.array([1.0, -1.0])


def mark_numbers(block: Block, marks: FilmMarks) -> list[Finding]:
    """What is wrong with the marks of film images as a whole, as far as there is a remedy."""
    size = np.einsum("nii->ni", marks.nominal)
    measured = (marks.measured, marks.calibrated_mm, marks.sigma_mm, marks.present)
    upright, mirrored = (fit_fiducials("similarity", *measured, size * way) for way in (np.ones(2), MIRROR))
    wrong = [_wrong(block, marks, upright, mirrored, k) for k in range(len(marks.image))]
    alike: dict[tuple[str, str], list[int]] = {}
    for k, one in enumerate(wrong):
        if one is not None:
            alike.setdefault(one, []).append(k)
    findings = []
    for (what, remedy), rows in alike.items():
        ids = block.images.id[marks.image[rows]].tolist()
        which = f"image {ids[0]}" if len(ids) == 1 else f"{len(ids)} of {len(wrong)} film images, {shown(ids, 3)}"
        where = block.read_at(block.fiducial_points, int(marks.row[rows[0], marks.present[rows[0]]][0]))
        findings.append(Finding("mark_numbers", "error", f"{which}: {what}", remedy, where=where))
    return findings


def _wrong(
    block: Block, marks: FilmMarks, upright: FiducialFit, mirrored: FiducialFit, k: int
) -> tuple[str, str] | None:
    """What is wrong with the marks of an image, and the remedy."""
    if not upright.determined[k]:
        return None
    present = marks.present[k]
    calibrated = marks.calibrated_mm[k, present]
    rows, marked = marks.row[k, present], block.fiducial_points
    if not is_misfit(upright.residual_mm[k, present], calibrated):
        scale = scale_problem(upright.photo_from_nominal[k])
        remedy = "check the pixel size, the unit of the fiducial coordinates, and whether they are those of the camera"
        return (scale, remedy) if scale else None
    nominal = marks.measured[k, present] @ marks.nominal[k].T
    names = block.fiducials.id[marked.fiducial[rows]]

    def mapping(way: Float) -> str:
        numbering = renumbering(nominal * way, calibrated)
        return "" if numbering is None else ", ".join(f"{a} is {b}" for a, b in zip(names, names[numbering]) if a != b)

    exchanged, direction = mapping(np.ones(2)), "check pixel: {y: down} or {y: up} of the camera"
    if not is_misfit(mirrored.residual_mm[k, present], calibrated):
        also = f", or exchange numbers: {exchanged}" if exchanged else ""
        remedy = f"{direction} (a comparator counts y up), and on which side the film lay{also}"
        return "the fiducial marks fit only as a mirror image", remedy
    if exchanged:
        return "the numbers of the fiducial marks are exchanged", exchanged
    if both := mapping(MIRROR):
        what = "the fiducial marks fit only as a mirror image, and with their numbers exchanged"
        return what, f"{both}; and {direction}"
    return None
