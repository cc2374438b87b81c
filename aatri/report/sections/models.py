"""Models of relative orientation: pairs without one, and why; what nothing controls."""

from aatri.artifacts.models import Models
from aatri.report.sections.parts import PageSection, Surroundings, present
from aatri.report.sections.tables import Columns, all_rows
from aatri.report.sections.uncontrolled import uncontrolled_counts, uncontrolled_table


def show(made: PageSection, models: Models, _around: Surroundings) -> None:
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
