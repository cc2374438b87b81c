"""Tables of observations one by one: residual, standard deviation, redundancy number and test, the largest first.

Suspects by the stage that tested them and by kind, and each of them by id; what nothing controls, likewise.
"""

from collections import Counter

import numpy as np

from aatri.adjustment.statistics.limits import LEAST_CONTROLLED
from aatri.arrays import Bool, Float
from aatri.artifacts.solution import ProposedNumbers, Solution
from aatri.artifacts.suspects import Suspects, Uncontrolled
from aatri.ids import shown
from aatri.report.sections.parts import present
from aatri.report.sections.tables import Columns, PageTable, all_rows, axes, errors
from aatri.report.view.numbers import in_trade_unit, number, spoken
from aatri.units import DASH, digits

OF_POINTS = ("image_point", "control")
"""Kinds of observation that are too many, or have tables of their own."""


def of_images(solution: Solution) -> PageTable | None:
    """Positions, attitudes and rigs: what is observed of images as a whole."""
    residuals = solution.residuals
    rows = (residuals.image != "") & (residuals.point == "") & (residuals.row >= 0)
    return listed(solution, rows, "image", "Observed positions, attitudes and rigs of images")


def of_the_network(solution: Solution) -> PageTable | None:
    """Geodetic observations and relative control: what is observed between points."""
    residuals = solution.residuals
    rows = (residuals.point != "") & (residuals.image == "") & ~np.isin(residuals.kind, OF_POINTS)
    return listed(solution, rows, "between", "Geodetic observations and relative control")


def listed(solution: Solution, chosen: Bool, names: str, caption: str) -> PageTable | None:
    """Some observations, the largest residuals in sigmas first; `names` is the head of the column of ids."""
    residuals, tests = solution.residuals, solution.tests
    rows = np.flatnonzero(chosen & ~np.isin(residuals.kind, OF_POINTS) & np.isfinite(residuals.residual).any(axis=1))
    sigma = residuals.sigma[rows]
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.abs(residuals.residual[rows]) / np.where(sigma > 0, sigma, np.nan)
    rows = rows[np.argsort(-np.nan_to_num(np.fmax.reduce(size, axis=1)), kind="stable")]
    units = [in_trade_unit(unit) for unit in residuals.unit[rows].tolist()]
    factor = np.array([f for f, _ in units])[:, None]
    columns: Columns = {
        "observation": (residuals.kind[rows], spoken),
        names: (residuals.image if names == "image" else residuals.point)[rows],
        "used": np.where(residuals.active[rows], "yes", "rejected"),
        "unit": [unit for _, unit in units],
        "residual": (factor * residuals.residual[rows], _each),
        "sigma": (factor * residuals.sigma[rows], _each),
    }
    if tests is not None:
        columns |= {"redundancy": (tests.redundancy[rows], _each), "w": (tests.test[rows], _each)}
    return all_rows(f"{caption}, the largest residuals in sigmas first", columns)


def _each(values: Float) -> str:
    """The components that there are."""
    return ", ".join(number(float(v)) for v in values[np.isfinite(values)]) or DASH


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
        f"number below {LEAST_CONTROLLED:g})"
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
