"""Reliability: redundancy, detectable gross errors, their effect, the largest tests, what nothing controls."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from aatri.arrays import Float, Int
from aatri.artifacts.solution import Solution
from aatri.report.numbers import DASH, number
from aatri.report.sections import tables
from aatri.report.sections.parts import present
from aatri.report.sections.tables import Cells, PageTable
from aatri.report.sections.uncontrolled import UNCONTROLLED, uncontrolled_table


def reliability_tables(solution: Solution) -> list[PageTable]:
    """By kind, and the observations with the largest tests, where they were computed; what nothing controls."""
    loose = uncontrolled_table(solution.uncontrolled)
    if solution.tests is None:
        return present(loose)
    return present(_by_kind(solution), _largest(solution), _worst_effects(solution), loose)


def variance_table(solution: Solution) -> PageTable | None:
    """Variance components: what the residuals say of the standard deviations."""
    c = solution.variance_components
    if c is None:
        return None
    columns: Cells = {
        "group": lambda k: str(c.group[k]),
        "verdict": lambda k: str(c.verdict[k]),
        "observations": lambda k: number(int(c.observations[k])),
        "redundancy": lambda k: number(float(c.redundancy[k])),
        "factor": lambda k: number(float(c.factor[k])),
        "from": lambda k: number(float(c.low[k])),
        "to": lambda k: number(float(c.high[k])),
    }
    caption = "Variance components: factors on the standard deviations given, with 95 % limits"
    return tables.all_rows(caption, c, columns, 2)


def _by_kind(solution: Solution) -> PageTable | None:
    residuals, tests = solution.residuals, solution.tests
    assert tests is not None
    rows = []
    for kind in np.unique(residuals.kind):
        mine = (residuals.kind == kind) & residuals.active
        r, w, size = tests.redundancy[mine], tests.test[mine], tests.detectable[mine]
        known = np.isfinite(r)
        if not known.any():
            continue
        unit = str(residuals.unit[np.flatnonzero(mine)[0]])
        found, effect = size[np.isfinite(size)], tests.external[mine]
        moved = tests.point_moved_m[mine]
        rows.append((
            str(kind), unit, number(int(known.sum())), number(float(r[known].mean())), number(float(r[known].min())),
            number(int((r[known] < UNCONTROLLED).sum())),
            number(float(np.median(found))) if len(found) else DASH, number(float(found.max())) if len(found) else DASH,
            _of(np.nanmedian, effect), _of(np.nanmax, effect), _of(np.nanmax, moved), _of(np.nanmax, np.abs(w)),
        ))  # fmt: skip
    heads = (
        *("observations", "unit", "tested", "mean redundancy", "smallest", "uncontrolled", "median detectable error"),
        *("largest", "median external", "largest external", "largest effect on a point (m)", "largest |w|"),
    )
    caption = (
        "Reliability by kind; detectable with 80 % at a level of 0.1 %; external: largest effect of such an error on "
        "any function of the unknowns, in its standard deviations"
    )
    return PageTable(caption, heads, rows, 2) if rows else None


def _of(figure: Callable[[Float], float], values: Float) -> str:
    return number(float(figure(values))) if np.isfinite(values).any() else DASH


def _worst_effects(solution: Solution) -> PageTable | None:
    """Observations whose undetected errors do most to the result."""
    residuals, tests = solution.residuals, solution.tests
    assert tests is not None
    effect = np.where(residuals.active[:, None] & np.isfinite(tests.external), tests.external, -1.0)
    axis, most = effect.argmax(axis=1), effect.max(axis=1)
    order = np.argsort(-most, kind="stable")[: tables.MOST_ROWS]
    order = order[most[order] > 0]

    def cell(values: Float) -> Callable[[int], str]:
        return lambda k: _of(np.nanmax, values[order[k], axis[order[k]]][None])

    columns = _named(solution, order, axis) | {
        "detectable": cell(tests.detectable),
        "external": cell(tests.external),
        "moves its point (m)": cell(tests.point_moved_m),
        "its image (m)": cell(tests.image_moved_m),
        "turns it (rad)": cell(tests.image_turned_rad),
    }
    return tables.all_rows("Detectable errors with the largest effect on the unknowns", order, columns, 5)


def _named(solution: Solution, order: Int, axis: Int, *, by_row: bool = True) -> Cells:
    """Columns that say which observation it is; `axis` by row of the residuals, or one by one."""
    residuals = solution.residuals
    return {
        "observation": lambda k: str(residuals.kind[order[k]]),
        "image": lambda k: str(residuals.image[order[k]]) or DASH,
        "point": lambda k: str(residuals.point[order[k]]) or DASH,
        "axis": lambda k: "xyz"[axis[order[k]] if by_row else axis[k]],
        "unit": lambda k: str(residuals.unit[order[k]]),
    }


def _largest(solution: Solution) -> PageTable | None:
    residuals, tests = solution.residuals, solution.tests
    assert tests is not None
    w = np.fmax.reduce(np.abs(tests.test), axis=1)
    order = np.argsort(np.where(np.isfinite(w) & residuals.active, -w, np.inf), kind="stable")
    order = order[np.isfinite(w[order]) & residuals.active[order]][: tables.MOST_ROWS]
    axis = np.nanargmax(np.where(np.isfinite(tests.test[order]), np.abs(tests.test[order]), -1.0), axis=1)
    columns: Cells = _named(solution, order, axis, by_row=False) | {
        "w": lambda k: f"{tests.test[order[k], axis[k]]:.2f}",
        "residual": lambda k: number(float(residuals.residual[order[k], axis[k]])),
        "redundancy": lambda k: number(float(tests.redundancy[order[k], axis[k]])),
        "detectable": lambda k: number(float(tests.detectable[order[k], axis[k]])),
    }
    return tables.all_rows("Largest tests of observations in use", order, columns, 5)
