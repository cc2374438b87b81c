"""What nothing controls: how many of each kind, and every one with its direction."""

import numpy as np

from aatri.adjustment.statistics.uncontrolled import BELOW as UNCONTROLLED
from aatri.artifacts.suspects import Uncontrolled
from aatri.ids import shown
from aatri.report.sections.tables import Columns, PageTable, all_rows, axes
from aatri.report.view.numbers import number, spoken
from aatri.units import digits


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
