"""Models of relative orientation: pairs without one, and why."""

from __future__ import annotations

from aatri.artifacts.models import Models
from aatri.report.numbers import number
from aatri.report.sections import tables
from aatri.report.sections.parts import Section, Surroundings, present


def show(made: Section, models: Models, _around: Surroundings) -> None:
    """Add neighbours without a model."""
    unformed = models.unformed
    columns = {
        "left": lambda k: str(models.images.id[unformed.left[k]]),
        "right": lambda k: str(models.images.id[unformed.right[k]]),
        "why": lambda k: str(unformed.reason[k]),
        "common points": lambda k: number(int(unformed.common_points[k])),
    }
    made.tables.extend(present(tables.all_rows("Neighbours without a model", unformed, columns, 3)))
