"""Strips: gaps, and why; what nothing controls."""

from __future__ import annotations

from aatri.artifacts.strips import Strips
from aatri.report.sections import tables
from aatri.report.sections.parts import Section, Surroundings, present
from aatri.report.sections.uncontrolled import uncontrolled_counts, uncontrolled_table


def show(made: Section, strips: Strips, _around: Surroundings) -> None:
    """Add gaps, and what is uncontrolled."""
    gaps = strips.gaps
    columns = {
        "strip": lambda k: str(gaps.strip[k]),
        "before the gap": lambda k: str(gaps.left[k]),
        "after": lambda k: str(gaps.right[k]),
        "why": lambda k: str(gaps.reason[k]),
    }
    made.tables.extend(present(tables.all_rows("Gaps", gaps, columns, 4)))
    made.tables.extend(present(uncontrolled_counts(strips.uncontrolled), uncontrolled_table(strips.uncontrolled)))
