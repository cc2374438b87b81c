"""Reliability: redundancy, detectable gross errors and the largest tests, by kind of observation."""

from __future__ import annotations

import numpy as np

from aatri.artifacts.solution import Solution
from aatri.report.numbers import DASH, number
from aatri.report.sections import tables
from aatri.report.sections.parts import present
from aatri.report.sections.tables import Cells, PageTable

UNCONTROLLED = 0.01
"""A smaller redundancy number means that no gross error of the observation can be seen."""


def reliability_tables(solution: Solution) -> list[PageTable]:
    """By kind, and the observations with the largest tests; nothing if they were not computed."""
    if solution.tests is None:
        return []
    return present(_by_kind(solution), _largest(solution))


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
        found = size[np.isfinite(size)]
        rows.append((
            str(kind), unit, number(int(known.sum())), number(float(r[known].mean())), number(float(r[known].min())),
            number(int((r[known] < UNCONTROLLED).sum())),
            number(float(np.median(found))) if len(found) else DASH, number(float(found.max())) if len(found) else DASH,
            number(float(np.nanmax(np.abs(w)))) if np.isfinite(w).any() else DASH,
        ))  # fmt: skip
    heads = ("observations", "unit", "tested", "mean redundancy", "smallest", "uncontrolled", "median detectable error",
             "largest", "largest |w|")  # fmt: skip
    return PageTable("Reliability by kind; detectable with 80 % at a level of 0.1 %", heads, rows, 2) if rows else None


def _largest(solution: Solution) -> PageTable | None:
    residuals, tests = solution.residuals, solution.tests
    assert tests is not None
    w = np.fmax.reduce(np.abs(tests.test), axis=1)
    order = np.argsort(np.where(np.isfinite(w) & residuals.active, -w, np.inf), kind="stable")
    order = order[np.isfinite(w[order]) & residuals.active[order]][: tables.MOST_ROWS]
    axis = np.nanargmax(np.where(np.isfinite(tests.test[order]), np.abs(tests.test[order]), -1.0), axis=1)
    columns: Cells = {
        "observation": lambda k: str(residuals.kind[order[k]]),
        "image": lambda k: str(residuals.image[order[k]]) or DASH,
        "point": lambda k: str(residuals.point[order[k]]) or DASH,
        "axis": lambda k: "xyz"[axis[k]],
        "unit": lambda k: str(residuals.unit[order[k]]),
        "w": lambda k: f"{tests.test[order[k], axis[k]]:.2f}",
        "residual": lambda k: number(float(residuals.residual[order[k], axis[k]])),
        "redundancy": lambda k: number(float(tests.redundancy[order[k], axis[k]])),
        "detectable": lambda k: number(float(tests.detectable[order[k], axis[k]])),
    }
    return tables.all_rows("Largest tests of observations in use", order, columns, 5)
