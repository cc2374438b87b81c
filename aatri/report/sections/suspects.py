"""Suspects by the stage that tested them and by kind, and each of them by id."""

from __future__ import annotations

from collections import Counter

import numpy as np

from aatri.artifacts.solution import ProposedNumbers
from aatri.artifacts.suspects import Suspects
from aatri.report.numbers import DASH, number
from aatri.report.sections import tables
from aatri.report.sections.parts import present
from aatri.report.sections.tables import Cells, PageTable


def suspects_tables(suspects: Suspects) -> list[PageTable]:
    """How many of each stage, kind and verdict; then all, the largest test first."""
    if not len(suspects):
        return []
    counts = Counter(zip(suspects.stage.tolist(), suspects.kind.tolist(), suspects.verdict.tolist()))
    summary = PageTable("Suspects by stage and kind", ("tested by", "observation", "verdict", "count"),
                        [(*key, number(n)) for key, n in sorted(counts.items())], 3)  # fmt: skip
    order = np.argsort(-np.abs(np.nan_to_num(suspects.test)), kind="stable")
    columns: Cells = {
        "tested by": lambda k: str(suspects.stage[order[k]]),
        "observation": lambda k: str(suspects.kind[order[k]]),
        "image": lambda k: str(suspects.image[order[k]]) or DASH,
        "point": lambda k: str(suspects.point[order[k]]) or DASH,
        "verdict": lambda k: str(suspects.verdict[order[k]]),
        "unit": lambda k: str(suspects.unit[order[k]]),
        "size": lambda k: number(float(suspects.size[order[k]])),
        "sigma": lambda k: number(float(suspects.sigma[order[k]])),
        "test": lambda k: number(float(suspects.test[order[k]])),
    }
    return present(summary, tables.all_rows("Suspects, the largest test first", suspects, columns, 6))


def proposed_numbers_table(proposed: ProposedNumbers | None) -> PageTable | None:
    """Numbers under which rejected observations fit."""
    if proposed is None or not len(proposed):
        return None
    columns: Cells = {
        "observation": lambda k: str(proposed.kind[k]),
        "image": lambda k: str(proposed.image[k]) or DASH,
        "point": lambda k: str(proposed.point[k]),
        "fits": lambda k: str(proposed.proposed[k]),
        "exchanged": lambda k: "both" if proposed.exchanged[k] else DASH,
    }
    return tables.all_rows("Rejected observations that fit under another number", proposed, columns, 5)
