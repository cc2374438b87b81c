"""What nothing controls: how many of each kind, and every one with its direction."""

import numpy as np

from aatri.artifacts.uncontrolled import Uncontrolled
from aatri.ids import shown
from aatri.report.sections.tables import Columns, PageTable, all_rows, axes
from aatri.report.view.numbers import digits, number

UNCONTROLLED = 0.01
"""A smaller redundancy number means that no gross error of the observation can be seen; so the table is made."""


def uncontrolled_table(found: Uncontrolled | None) -> PageTable | None:
    """Observations with a direction in which no gross error can be seen."""
    if found is None:
        return None
    columns: Columns = {
        "observation": found.kind,
        "image": found.image,
        "point": found.point,
        "redundancy": found.redundancy,
        **axes("xyz", found.direction, digits(2)),
    }
    caption = (
        f"Uncontrolled, redundancy number below {UNCONTROLLED:g}: a gross error in the direction x, y, z shows nowhere"
    )
    return all_rows(caption, columns)


def uncontrolled_counts(found: Uncontrolled | None) -> PageTable | None:
    """How many of each kind, before the bundle, and the first points."""
    if found is None or not len(found):
        return None
    without = np.isnan(found.direction).all(axis=1) & (found.kind == "image_point")
    kinds = np.where(without, "image_point in no model", found.kind)
    rows = []
    for kind in np.unique(kinds):
        mine = found.take(kinds == kind)
        names = np.unique(np.where(mine.point == "", mine.image, mine.point))
        rows.append((str(kind), shown(names.tolist(), 8), number(len(mine)), number(len(names))))
    return PageTable("Uncontrolled before the bundle, by kind", ("observation", "of", "count", "points"), rows, 2)
