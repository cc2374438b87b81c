"""Collocation of the residuals of a solution, from its tables to corrected image points."""

from __future__ import annotations

import numpy as np

from aatri.adapters.cameras.sharing import Sharing, units_of
from aatri.adapters.refinement.corrected import with_corrections
from aatri.arrays import Bool, Float
from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.solution import Solution
from aatri.notes import Note
from aatri.orientation.refinement.collocation import collocate_groups


def compensated(
    block: Block, image_points: ImagePoints, solution: Solution, *, per: Sharing, model: str, cells_per_side: int
) -> tuple[ImagePoints, tuple[Note, ...]]:
    """Image points less the common part of their residuals, and what was found.

    Parameters
    ----------
    per : str
        camera or session: whose residuals are laid over each other.
    model, cells_per_side
        As of `collocate_groups`.
    """
    m = image_points.measurements
    residual_mm, used = _image_residuals(solution, len(m))
    rows = np.flatnonzero(np.isfinite(m.xy_mm).all(axis=1))
    units = units_of(block, per)
    correction, _, found = collocate_groups(
        units.of_image[m.image[rows]], m.xy_mm[rows], residual_mm[rows], used[rows],
        model=model, cells_per_side=cells_per_side,
    )  # fmt: skip
    notes = []
    if not used.any():
        notes.append(Note("warning", "the solution has no residuals of image points: nothing is corrected"))
    for unit, one in found.items():
        signal = "residuals without correlated part, nothing is corrected"
        if one.function is not None:
            signal = f"signal {1e3 * np.sqrt(one.function.variance_mm2):.2f} um"
        notes.append(Note("note", f"{units.id[unit]}: {signal}"))
    xy = m.xy_mm.copy()
    xy[rows] += correction
    largest = float(np.linalg.norm(correction, axis=1).max(initial=0.0))
    before = sum(str(name).startswith("collocation") for name in image_points.corrections.name)
    name = "collocation" if before == 0 else f"collocation {before + 1}"
    return with_corrections(image_points, xy, [name], [largest]), tuple(notes)


def _image_residuals(solution: Solution, n: int) -> tuple[Float, Bool]:
    """Residuals by row of the image points, and which of them are there and active."""
    r = solution.residuals
    mine = np.flatnonzero((r.kind == "image_point") & (r.row >= 0))
    residual, used = np.zeros((n, 2)), np.zeros(n, dtype=bool)
    residual[r.row[mine]] = r.residual[mine, :2]
    used[r.row[mine]] = r.active[mine] & np.isfinite(r.residual[mine, :2]).all(axis=1)
    return residual, used
