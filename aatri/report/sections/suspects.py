"""Suspects by the stage that tested them and by kind, and each of them by id; what nothing controls, likewise."""

from collections import Counter

import numpy as np

from aatri.adjustment.statistics.record_tests import BELOW as UNCONTROLLED
from aatri.artifacts.solution import ProposedNumbers
from aatri.artifacts.suspects import Suspects, Uncontrolled
from aatri.ids import shown
from aatri.report.sections.parts import present
from aatri.report.sections.tables import Columns, PageTable, all_rows, axes, errors
from aatri.report.view.numbers import number, spoken
from aatri.units import DASH, digits


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


def uncontrolled_table(uncontrolled: Uncontrolled | None) -> PageTable | None:
    """Observations with a direction in which no gross error can be seen."""
    if uncontrolled is None:
        return None
    columns: Columns = {
        "observation": (uncontrolled.kind, spoken),
        "image": uncontrolled.image,
        "point": uncontrolled.point,
        "redundancy": (uncontrolled.redundancy, digits(3)),
        **axes("xyz", uncontrolled.direction, digits(2)),
    }
    caption = (
        "Observations that nothing controls in a direction x, y, z: a gross error along it shows nowhere (redundancy "
        f"number below {UNCONTROLLED:g})"
    )
    return all_rows(caption, columns)


def uncontrolled_counts(uncontrolled: Uncontrolled | None) -> PageTable | None:
    """How many of each kind, before the bundle, and the first points."""
    if uncontrolled is None or not len(uncontrolled):
        return None
    without = np.isnan(uncontrolled.direction).all(axis=1) & (uncontrolled.kind == "image_point")
    kinds = np.where(without, "image_point in no model", uncontrolled.kind)
    rows = []
    for kind in np.unique(kinds):
        of_kind = uncontrolled.take(kinds == kind)
        names = np.unique(np.where(of_kind.point == "", of_kind.image, of_kind.point))
        rows.append((spoken(str(kind)), shown(names.tolist(), 8), number(len(of_kind)), number(len(names))))
    return PageTable("Uncontrolled before the bundle, by kind", ("observation", "of", "count", "points"), rows, 2)
