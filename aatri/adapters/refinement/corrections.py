"""Image points corrected: for distortion, refraction, earth curvature, in this order, or for anything else."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aatri.adapters.refinement.earth import earth_correction
from aatri.adapters.refinement.heights import stations_of
from aatri.adapters.refinement.lens import lens_correction
from aatri.arrays import Float
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import Corrections, ImagePoints
from aatri.artifacts.solution import Solution
from aatri.camera.corrections.atmosphere import Atmosphere
from aatri.errors import SpecError
from aatri.geometry.vectors import largest_length
from aatri.notes import Note

IN_ORDER = ("distortion", "refraction", "earth_curvature")


def with_corrections(
    image_points: ImagePoints, xy_mm: Float, names: Sequence[str], largest_mm: Sequence[float]
) -> ImagePoints:
    """The image points at corrected places.

    Parameters
    ----------
    xy_mm : (n, 2) float64, mm
        Corrected coordinates of all measurements.
    names, largest_mm : sequences
        The corrections made, in order, and the largest length of each.
    """
    done = image_points.corrections
    return replace(
        image_points,
        measurements=replace(image_points.measurements, xy_mm=xy_mm),
        corrections=Corrections(
            name=np.concatenate([done.name, np.array(names, dtype=np.str_)]),
            largest_mm=np.concatenate([done.largest_mm, largest_mm]),
        ),
    )


def systematically_corrected(
    block: Block,
    image_points: ImagePoints,
    requested: Sequence[str],
    poses: Solution | None = None,
    atmosphere: Atmosphere = "coefficients",
) -> tuple[ImagePoints, tuple[Note, ...]]:
    """Image points freed from what is wanted of `IN_ORDER`, and what is to be said of it.

    Parameters
    ----------
    poses : Solution, optional
        Orientations: every ray is corrected in its own vertical plane.

    Raises
    ------
    SpecError
        If a correction has been made before.
    InputError
        If a distortion is not known or folds.
    """
    requested, notes = _to_apply(block, image_points, requested)
    m = image_points.measurements
    xy = m.xy_mm.copy()
    rows = np.isfinite(xy).all(axis=1)
    image = m.image[rows]
    largest, stations = [], None
    for name in requested:
        if name == "distortion":
            correction, more = lens_correction(block, image, xy[rows])
        else:
            if stations is None:
                stations, more = stations_of(block, image_points, poses)
                notes += more
            correction, more = earth_correction(name, block, stations, image, xy[rows], m.sigma_mm[rows], atmosphere)
        notes += more
        xy[rows] += correction
        largest.append(largest_length(correction[m.active[rows]]))
        notes.append(Note("note", f"{name}: at most {1e3 * largest[-1]:.2f} um"))
    return with_corrections(image_points, xy, requested, largest), tuple(notes)


def without_distortion(block: Block, image_points: ImagePoints) -> tuple[ImagePoints, tuple[Note, ...]]:
    """Image points of a central projection, for stages that know no lens; as they are where they have been corrected.

    A calibration leaves the distortion in the image points, for the bundle to find.
    """
    if "distortion" in image_points.corrections.name or (block.cameras.distortion == "none").all():
        return image_points, ()
    corrected, notes = systematically_corrected(block, image_points, ["distortion"], None, "coefficients")
    text = (
        "the image points are not corrected for the distortion of the lens: as the block gives it, it is used here only"
    )
    return corrected, (Note("note", text), *notes)


def _to_apply(block: Block, image_points: ImagePoints, requested: Sequence[str]) -> tuple[list[str], list[Note]]:
    """The corrections to make, in order; those that the block has no use for are left out with a note."""
    names, notes = [name for name in IN_ORDER if name in requested], []
    twice = [name for name in names if name in image_points.corrections.name]
    if twice:
        raise SpecError(
            f"already applied to these image points: {', '.join(twice)}",
            where="image_refinement/systematic",
            remedy=f"switch off here: with: {{{', '.join(f'{name}: false' for name in twice)}}}",
        )
    if "earth_curvature" in names and block.earth_curvature != "correct":
        text = f"earth curvature is not corrected: the block says earth_curvature: {block.earth_curvature}"
        notes.append(Note("note", text))
        names.remove("earth_curvature")
    if "distortion" in names and (block.cameras.distortion == "none").all():
        notes.append(Note("note", "no distortion is corrected: the cameras have none"))
        names.remove("distortion")
    return names, notes
