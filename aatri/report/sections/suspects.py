"""Suspects by the stage that tested them and by kind, and each of them by id."""

from collections import Counter

import numpy as np

from aatri.artifacts.solution import ProposedNumbers
from aatri.artifacts.suspects import Suspects
from aatri.report.sections.parts import present
from aatri.report.sections.tables import Columns, PageTable, all_rows, errors
from aatri.report.view.numbers import number, spoken
from aatri.units import DASH


def suspects_tables(suspects: Suspects) -> list[PageTable]:
    """How many of each stage, kind and verdict; then all, the largest test first."""
    if not len(suspects):
        return []
    counts = Counter(zip(suspects.stage.tolist(), suspects.kind.tolist(), suspects.verdict.tolist()))
    summary = PageTable(
        "Suspects by stage and kind",
        ("tested by", "observation", "verdict", "count"),
        [(*map(spoken, key), number(n)) for key, n in sorted(counts.items())],
        3,
    )
    order = np.argsort(-np.abs(np.nan_to_num(suspects.test)), kind="stable")
    columns: Columns = {
        "tested by": (suspects.stage, spoken),
        "observation": (suspects.kind, spoken),
        "image": suspects.image,
        "point": suspects.point,
        "verdict": suspects.verdict,
        **errors(suspects.unit.tolist(), {"size": suspects.size, "sigma": suspects.sigma}, suspects.sigma),
        "test": (suspects.test, "{:.1f}".format),
    }
    return present(summary, all_rows("Suspects, the largest test first", columns, order))


def proposed_numbers_table(proposed: ProposedNumbers | None) -> PageTable | None:
    """Numbers under which rejected observations fit."""
    if proposed is None:
        return None
    columns: Columns = {
        "observation": (proposed.kind, spoken),
        "image": proposed.image,
        "point": proposed.point,
        "fits": proposed.proposed,
        "exchanged": np.where(proposed.exchanged, "both", DASH),
    }
    return all_rows("Rejected observations that fit under another number", columns)
