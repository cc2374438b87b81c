"""A-posteriori compensation: what the residuals of an adjusted block have in common is taken off its image points.

The residuals of all images of a camera (or session) are laid over each other on the plate; their correlated part is
signal with a covariance function C(d), predicted at every image point by least squares and added to the measurement:

    s^ = c' (C + D)^-1 v,    v adjusted minus observed

Adjust the block again afterwards; each pass compensates the part that orientations and points have not taken up, so it
may be repeated. Residuals without correlated part correct nothing. Method and source:
aatri.orientation.refinement.collocation.
"""

from typing import Literal

import numpy as np

from aatri.adapters.cameras.unknowns import units_of
from aatri.adapters.refinement.corrections import with_corrections
from aatri.adapters.solution import check_same_block
from aatri.arrays import Bool, Float
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.checks.after.smooth_signal import smooth_signal
from aatri.checks.finding import report
from aatri.notes import Note
from aatri.orientation.refinement.collocation import collocate_groups
from aatri.plugin import SILENT, Context, Field, Options, stage


class CollocationOptions(Options):
    """How the signal is estimated."""

    per: Literal["camera", "session"] = Field("camera", description="whose residuals are laid over each other")
    model: Literal["best", "exponential", "gaussian"] = Field("best", description="covariance function")
    cells_per_side: int = Field(20, ge=4, le=60, description="cells along the longer side of the plate")


@stage(version=1, uses=lambda options: ("images.session",) if options.per == "session" else ())
def collocation(
    block: Block,
    image_points: ImagePoints,
    solution: Solution,
    *,
    options: CollocationOptions = CollocationOptions(),
    context: Context = SILENT,
) -> ImagePoints:
    """Image points less the common part of their residuals in a solution."""
    check_same_block(block, solution=solution)
    m = image_points.measurements
    residual_mm, used = _image_residuals(solution, len(m))
    rows = np.flatnonzero(np.isfinite(m.xy_mm).all(axis=1))
    units = units_of(block, options.per)
    correction, _, signals = collocate_groups(
        units.of_image[m.image[rows]],
        m.xy_mm[rows],
        residual_mm[rows],
        used[rows],
        model=options.model,
        cells_per_side=options.cells_per_side,
    )
    notes: list[Note] = []
    if not used.any():
        notes.append(Note("warning", "the solution has no residuals of image points: nothing is corrected"))
    for unit, one in signals.items():
        signal = "residuals without correlated part, nothing is corrected"
        if one.function is not None:
            signal = f"signal {1e3 * np.sqrt(one.function.variance_mm2):.2f} um"
        notes.append(Note("note", f"{units.id[unit]}: {signal}"))
    xy = m.xy_mm.copy()
    xy[rows] += correction
    largest = float(np.linalg.norm(correction, axis=1).max(initial=0.0))
    before = sum(str(name).startswith("collocation") for name in image_points.corrections.name)
    name = "collocation" if before == 0 else f"collocation {before + 1}"
    radius = np.zeros(len(units.id))
    np.maximum.at(radius, units.of_image[m.image[rows]], np.linalg.norm(m.xy_mm[rows], axis=1))
    report([*notes, *smooth_signal(signals, units.id, radius)], context)
    return with_corrections(image_points, xy, [name], [largest])


def _image_residuals(solution: Solution, n: int) -> tuple[Float, Bool]:
    """Residuals by row of the image points, and which of them are there and active."""
    r = solution.residuals
    rows_of_points = np.flatnonzero((r.kind == "image_point") & (r.row >= 0))
    residual, used = np.zeros((n, 2)), np.zeros(n, dtype=bool)
    residual[r.row[rows_of_points]] = r.residual[rows_of_points, :2]
    used[r.row[rows_of_points]] = r.active[rows_of_points] & np.isfinite(r.residual[rows_of_points, :2]).all(axis=1)
    return residual, used
