"""One section of the page per stage: what it made, in tables and pictures. Blocks and Solutions have their own file."""

from collections.abc import Callable
from typing import Any

import numpy as np

from aatri.artifacts.block import Block
from aatri.artifacts.image_points import ImagePoints
from aatri.artifacts.models import Models
from aatri.artifacts.solution import Solution
from aatri.artifacts.strips import Strips
from aatri.errors import AatriError
from aatri.report.sections import block, solution, tables
from aatri.report.sections.observations import suspects_tables, uncontrolled_counts, uncontrolled_table
from aatri.report.sections.parts import PageSection, Surroundings, present
from aatri.report.sections.tables import Columns, all_rows
from aatri.report.view.run_view import RunView, StageView


def section(run: RunView, stage: StageView, around: Surroundings) -> PageSection:
    """The section of a stage, also of one that failed or whose artifact cannot be read."""
    record = stage.record or {}
    made = PageSection(f"stage-{stage.name}", stage.name)
    single, by_axis = tables.without_axis(stage.metrics), tables.by_axis("Metrics by axis", stage.metrics)
    made.tables.extend(present(tables.pairs("Metrics", single), by_axis))
    options = (stage.failure or record).get("options", {})
    made.tables.extend(present(tables.folded(tables.pairs("Options", options))))
    if stage.status != "done":
        return made
    try:
        artifact = run.artifact(stage)
    except AatriError as error:
        made.notes.append(f"The artifact cannot be shown: {error}")
        return made
    if type(artifact) in _SHOW:  # an Information is told by its metrics, an Evaluation by the answer to accuracy
        _SHOW[type(artifact)](made, artifact, around)
    if hasattr(artifact, "suspects") and artifact is not around.solution:
        made.tables.extend(suspects_tables(artifact.suspects))
    return made


def _of_image_points(made: PageSection, artifact: ImagePoints, _around: Surroundings) -> None:
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


def _of_models(made: PageSection, models: Models, _around: Surroundings) -> None:
    """Add neighbours without a model, and what is uncontrolled."""
    unformed = models.unformed
    columns: Columns = {
        "left": models.images.id[unformed.left],
        "right": models.images.id[unformed.right],
        "why": unformed.reason,
        "common points": unformed.common_points,
    }
    made.tables.extend(present(all_rows("Neighbours without a model", columns)))
    made.tables.extend(present(uncontrolled_counts(models.uncontrolled), uncontrolled_table(models.uncontrolled)))


def _of_strips(made: PageSection, strips: Strips, _around: Surroundings) -> None:
    """Add gaps, and what is uncontrolled."""
    gaps = strips.gaps
    columns: Columns = {"strip": gaps.strip, "before the gap": gaps.left, "after": gaps.right, "why": gaps.reason}
    made.tables.extend(present(all_rows("Gaps", columns)))
    made.tables.extend(present(uncontrolled_counts(strips.uncontrolled), uncontrolled_table(strips.uncontrolled)))


_SHOW: dict[type, Callable[[PageSection, Any, Surroundings], None]] = {
    Block: block.show,
    ImagePoints: _of_image_points,
    Models: _of_models,
    Strips: _of_strips,
    Solution: solution.show,
}
