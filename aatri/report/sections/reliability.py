"""Reliability: redundancy, detectable gross errors, their effect, the largest tests, what nothing controls."""

from collections.abc import Callable

import numpy as np

from aatri.arrays import Float, Int
from aatri.artifacts.solution import Solution
from aatri.report.sections.parts import present
from aatri.report.sections.tables import MOST_ROWS, Columns, PageTable, all_rows
from aatri.report.sections.uncontrolled import UNCONTROLLED, uncontrolled_table
from aatri.report.view.numbers import DASH, number


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
    columns: Columns = {
        "group": c.group,
        "verdict": c.verdict,
        "observations": c.observations,
        "redundancy": c.redundancy,
        "factor": c.factor,
        "from": c.low,
        "to": c.high,
    }
    return all_rows("Variance components: factors on the standard deviations given, with 95 % limits", columns)


def _by_kind(solution: Solution) -> PageTable | None:
    residuals, tests = solution.residuals, solution.tests
    assert tests is not None
    rows = []
    for kind in np.unique(residuals.kind):
        mine = (residuals.kind == kind) & residuals.active
        r, w, size = tests.redundancy[mine], tests.test[mine], tests.detectable[mine]
        finite = np.isfinite(r)
        if not finite.any():
            continue
        unit = str(residuals.unit[np.flatnonzero(mine)[0]])
        detectable, effect = size[np.isfinite(size)], tests.external[mine]
        moved = tests.point_moved_m[mine]
        rows.append(
            (
                str(kind),
                unit,
                number(int(finite.sum())),
                number(float(r[finite].mean())),
                number(float(r[finite].min())),
                number(int((r[finite] < UNCONTROLLED).sum())),
                number(float(np.median(detectable))) if len(detectable) else DASH,
                number(float(detectable.max())) if len(detectable) else DASH,
                _of(np.nanmedian, effect),
                _of(np.nanmax, effect),
                _of(np.nanmax, moved),
                _of(np.nanmax, np.abs(w)),
            )
        )
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
    order = np.argsort(-most, kind="stable")[:MOST_ROWS]
    values = {
        "detectable": tests.detectable,
        "external": tests.external,
        "moves its point (m)": tests.point_moved_m,
        "its image (m)": tests.image_moved_m,
        "turns it (rad)": tests.image_turned_rad,
    }
    columns = _observation(solution, axis) | {head: _on_axis(of, axis) for head, of in values.items()}
    return all_rows("Detectable errors with the largest effect on the unknowns", columns, order[most[order] > 0])


def _observation(solution: Solution, axis: Int) -> Columns:
    """Columns that say which observation it is, and which axis of each."""
    r = solution.residuals
    return {
        "observation": r.kind,
        "image": r.image,
        "point": r.point,
        "axis": np.array(list("xyz"))[axis],
        "unit": r.unit,
    }


def _on_axis(values: Float, axis: Int) -> Float:
    return np.asarray(np.take_along_axis(values, axis[:, None], axis=1)[:, 0])


def _largest(solution: Solution) -> PageTable | None:
    residuals, tests = solution.residuals, solution.tests
    assert tests is not None
    w = np.fmax.reduce(np.abs(tests.test), axis=1)
    order = np.argsort(np.where(np.isfinite(w) & residuals.active, -w, np.inf), kind="stable")
    order = order[np.isfinite(w[order]) & residuals.active[order]][:MOST_ROWS]
    axis = np.argmax(np.where(np.isfinite(tests.test), np.abs(tests.test), -1.0), axis=1)
    columns = _observation(solution, axis) | {
        "w": (_on_axis(tests.test, axis), "{:.2f}".format),
        "residual": _on_axis(residuals.residual, axis),
        "redundancy": _on_axis(tests.redundancy, axis),
        "detectable": _on_axis(tests.detectable, axis),
    }
    return all_rows("Largest tests of observations in use", columns, order)
