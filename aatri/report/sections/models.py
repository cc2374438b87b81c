"""Models of relative orientation: pairs without one, and why; what nothing controls."""

from __future__ import annotations

from aatri.artifacts.models import Models
from aatri.report.numbers import number
from aatri.report.sections import tables
from aatri.report.sections.parts import Section, Surroundings, present
from aatri.report.sections.uncontrolled import uncontrolled_counts, uncontrolled_table


def show(made: Section, models: Models, _around: Surroundings) -> None:
    """Add neighbours without a model, and what is uncontrolled."""
    unformed = models.unformed
    columns = {
        "left": lambda k: str(models.images.id[unformed.left[k]]),
        "right": lambda k: str(models.images.id[unformed.right[k]]),
        "why": lambda k: str(unformed.reason[k]),
        "common points": lambda k: number(int(unformed.common_points[k])),
    }
    made.tables.extend(present(tables.all_rows("Neighbours without a model", unformed, columns, 3)))
    made.tables.extend(present(uncontrolled_counts(models.uncontrolled), uncontrolled_table(models.uncontrolled)))
