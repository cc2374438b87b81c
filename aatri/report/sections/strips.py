"""Strips: gaps, and why; what nothing controls."""

from aatri.artifacts.strips import Strips
from aatri.report.sections.parts import PageSection, Surroundings, present
from aatri.report.sections.tables import Columns, all_rows
from aatri.report.sections.uncontrolled import uncontrolled_counts, uncontrolled_table


def show(made: PageSection, strips: Strips, _around: Surroundings) -> None:
    """Add gaps, and what is uncontrolled."""
    gaps = strips.gaps
    columns: Columns = {"strip": gaps.strip, "before the gap": gaps.left, "after": gaps.right, "why": gaps.reason}
    made.tables.extend(present(all_rows("Gaps", columns)))
    made.tables.extend(present(uncontrolled_counts(strips.uncontrolled), uncontrolled_table(strips.uncontrolled)))
