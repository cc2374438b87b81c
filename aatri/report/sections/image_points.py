"""Photo coordinates: corrections made, residuals of fiducial marks."""

import numpy as np

from aatri.artifacts.image_points import ImagePoints
from aatri.report.sections.parts import PageSection, Surroundings, present
from aatri.report.sections.tables import Columns, all_rows


def show(made: PageSection, artifact: ImagePoints, _around: Surroundings) -> None:
    """Add corrections, and the fit of the fiducial marks."""
    corrections, residuals = artifact.corrections, artifact.fiducial_residuals
    columns: Columns = {"correction": corrections.name, "largest um": 1e3 * corrections.largest_mm}
    made.tables.extend(present(all_rows("Corrections applied", columns)))
    if residuals.active.any():
        v = 1e3 * residuals.residual_mm[residuals.active]
        made.notes.append(
            f"Fiducial residuals: RMS x {np.sqrt((v[:, 0] ** 2).mean()):.2f}, "
            f"y {np.sqrt((v[:, 1] ** 2).mean()):.2f} um, largest {np.abs(v).max():.2f} um, of {len(v):,} marks."
        )
