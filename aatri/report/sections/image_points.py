"""Photo coordinates: corrections made, residuals of fiducial marks."""

from __future__ import annotations

import numpy as np

from aatri.artifacts.image_points import ImagePoints
from aatri.report.numbers import number
from aatri.report.sections import tables
from aatri.report.sections.parts import Section, Surroundings, present


def show(made: Section, artifact: ImagePoints, _around: Surroundings) -> None:
    """Add corrections, and the fit of the fiducial marks."""
    corrections, residuals = artifact.corrections, artifact.fiducial_residuals
    columns = {
        "correction": lambda k: str(corrections.name[k]),
        "largest um": lambda k: number(1e3 * float(corrections.largest_mm[k])),
    }
    made.tables.extend(present(tables.all_rows("Corrections applied", corrections, columns, 1)))
    if residuals.active.any():
        v = 1e3 * residuals.residual_mm[residuals.active]
        made.notes.append(
            f"Fiducial residuals: RMS x {np.sqrt((v[:, 0] ** 2).mean()):.2f}, "
            f"y {np.sqrt((v[:, 1] ** 2).mean()):.2f} um, largest {np.abs(v).max():.2f} um, of {len(v):,} marks."
        )
