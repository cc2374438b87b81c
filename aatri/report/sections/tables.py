"""Tables of the page: heads and rows of text; what is long is cut, and the caption says so."""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.arrays import Float, Int
from aatri.artifacts.block import Rejects
from aatri.artifacts.solution import Solution
from aatri.report.sections.limits import LEAST_REDUNDANCY_OF_CLASS
from aatri.report.view.numbers import in_trade_unit, number, spoken
from aatri.report.view.run_view import RESULTS
from aatri.units import DASH, alike, decimals, digits, rms_alike

MOST_ROWS = 20
"""Rows of what is told by its worst only."""

LONG = 15
"""Tables of more rows are folded."""

MOST_PRINTED = 40
"""Tables of more rows are not printed, but for check points, orientations and the like."""

MOST_KEPT = 300
"""Those are printed up to this many rows, four pages; a block of thousands would fill fifty."""

MOST_FOLDED = 500
"""More rows are left to the export, and the caption says so."""

_AXIS = re.compile(r"_([xyz])(_|$)")


Column = npt.NDArray[Any] | Sequence[str] | tuple[npt.NDArray[Any], Callable[[Any], str]]
"""Values by row of a table: text, or numbers; these are written by `number`, or by the function beside them."""

Columns = dict[str, Column]
"""Columns by their heads."""


@dataclass(frozen=True)
class PageTable:
    """A table: `text_columns` leading columns are text, the others numbers; `folded` shows only its caption.

    On paper there are no folds: what is `kept` is printed up to four pages, other long tables are left to the page.
    """

    caption: str
    heads: Sequence[str]
    rows: Sequence[Sequence[str]]
    text_columns: int = 1
    folded: bool = False
    kept: bool = False

    @property
    def printed(self) -> bool:
        """Whether it is open on paper."""
        return len(self.rows) <= (MOST_KEPT if self.kept else MOST_PRINTED)


def pairs(caption: str, values: Mapping[str, Any]) -> PageTable | None:
    """Names and values, as of metrics and options; nested ones with dotted names."""
    rows = [(name, number(value)) for name, value in _flat(values)]
    return PageTable(caption, ("", ""), rows) if rows else None


def by_axis(caption: str, values: Mapping[str, Any]) -> PageTable | None:
    """The figures that exist for X, Y and Z, side by side: `check_rmse_x_m` is the row `check_rmse_m`."""
    rows: dict[str, list[str]] = {}
    for name, value in values.items():
        if axis := _AXIS.search(name):
            row = rows.setdefault(name[: axis.start()] + name[axis.end() - len(axis[2]) :], [DASH] * 3)
            row["xyz".index(axis[1])] = number(value)
    cells = [(name, *row) for name, row in rows.items()]
    return PageTable(caption, ("figure", "x", "y", "z"), cells) if rows else None


def without_axis(values: Mapping[str, Any]) -> dict[str, Any]:
    """The figures that are not of one axis."""
    return {name: value for name, value in values.items() if not _AXIS.search(name)}


def rejects_table(rejects: Rejects) -> PageTable | None:
    """What was set aside on import."""
    if not len(rejects):
        return None
    return all_rows("Set aside on import", {"what": rejects.kind, "id": rejects.id, "why": rejects.reason})


def all_rows(
    caption: str, columns: Mapping[str, Column], rows: Int | None = None, *, kept: bool = False
) -> PageTable | None:
    """Rows of a table up to `MOST_FOLDED`, by default all from the first; folded where they are many."""
    pairs = [column if isinstance(column, tuple) else (column, None) for column in columns.values()]
    rows = np.arange(len(pairs[0][0])) if rows is None else rows
    if not len(rows):
        return None
    texts = [form in (None, spoken) and isinstance(values[0], str) for values, form in pairs]
    cells = [[_cell(values[k], form) for k in rows[:MOST_FOLDED].tolist()] for values, form in pairs]
    caption = f"{caption}{_of(len(cells[0]), len(rows), 'first')}"
    return folded(PageTable(caption, tuple(columns), list(zip(*cells)), [*texts, False].index(False), kept=kept))


def axes(names: Iterable[str], values: Float, form: Callable[[float], str]) -> Columns:
    """A column for each column of some numbers."""
    return {name: (values[:, i], form) for i, name in enumerate(names)}


def lengths(names: str, values_m: Float) -> Columns:
    """Lengths in the unit and with the digits that suit their median, a column for each name; (n,) or (n, k), m.

    Names stand between blanks, `_` is a blank within one.
    """
    values = values_m[:, None] if values_m.ndim == 1 else values_m
    size = np.abs(values[np.isfinite(values) & (values != 0)])
    typical = float(np.median(size)) if size.size else 1.0
    factor, unit = next(((f, u) for f, u in ((1.0, "m"), (1e3, "mm")) if typical * f >= 1.0), (1e6, "um"))
    form = digits(decimals(typical * factor, 3))
    heads = (f"{name.replace('_', ' ')} {unit}" for name in names.split())
    return {head: (values[:, k] * factor, form) for k, head in enumerate(heads)}


def errors(units: Sequence[str], sizes: Mapping[str, Float], sigmas: Float) -> Columns:
    """Sizes of errors and their standard deviations in the units of the trade, row by row to digits of the latter.

    Parameters
    ----------
    units : (n,) str
    sizes : mapping of str to (n,) float64
        Columns by their heads.
    sigmas : (n,) float64
    """
    scaled = [in_trade_unit(unit) for unit in units]
    factor = np.array([f for f, _ in scaled])
    forms = [digits(decimals(sigma)) if sigma > 0 else number for sigma in (sigmas * factor).tolist()]
    columns: Columns = {"unit": [unit for _, unit in scaled]}
    for head, values in sizes.items():
        texts = [form(value) for form, value in zip(forms, (values * factor).tolist())]
        columns[head] = (np.array(texts, dtype=object), str)
    return columns


def _cell(value: Any, form: Callable[[Any], str] | None) -> str:
    if form is not None:
        return form(value)
    return (value or DASH) if isinstance(value, str) else number(value.item())


def folded(table: PageTable | None) -> PageTable | None:
    """A long table shows only its caption until it is opened."""
    return replace(table, folded=True) if table is not None and len(table.rows) > LONG else table


def observation_classes(solution: Solution) -> PageTable | None:
    """By kind of observation: how many, standard deviation given and a posteriori, residuals, the largest and where.

    The standard deviation a posteriori is that given, times the root of v'Pv over the redundancy of the class:
    `s_g = s sqrt(sum (v / s)^2 / sum r)`; times sigma0 where redundancy numbers were not computed.
    """
    residuals, tests = solution.residuals, solution.tests
    sigma0 = float(solution.sigma0 / solution.sigma_scale) if solution.redundancy else np.nan
    out = solution.suspects.kind[solution.suspects.staying_out]  # also of points that have no other ray any more
    rows = []
    for kind in residuals.kinds:
        used = residuals.used(kind)
        if not len(used):
            continue
        v, sigma = residuals.residual[used], residuals.sigma[used]
        weighted = np.isfinite(v) & (sigma > 0)
        factor, unit = in_trade_unit(str(residuals.unit[used[0]]))
        if not unit and weighted.any():  # of several units, as film corrections: in standard deviations
            v = np.divide(v, sigma, out=np.full_like(v, np.nan), where=weighted)
            sigma, unit = weighted.astype(float), "sigma"
        a_priori = float(np.median(sigma[weighted])) if weighted.any() else np.nan
        after = a_priori * sigma0
        if tests is not None and weighted.any():
            redundancy = float(np.nansum(tests.redundancy[used][weighted]))
            if redundancy > LEAST_REDUNDANCY_OF_CLASS:
                after = a_priori * float(np.sqrt(np.sum((v[weighted] / sigma[weighted]) ** 2) / redundancy))
        size = np.where(np.isfinite(v), np.abs(v), -1.0).max(axis=1)
        worst = used[int(np.argmax(size))]
        where = " / ".join(filter(None, (str(residuals.image[worst]), str(residuals.point[worst]))))
        rms = float(np.sqrt(np.mean(v[np.isfinite(v)] ** 2))) if np.isfinite(v).any() else np.nan
        form = (
            digits(decimals(factor * (a_priori if np.isfinite(a_priori) and a_priori > 0 else rms), 3))
            if unit
            else number
        )
        rows.append(
            (
                spoken(kind),
                unit,
                where or DASH,
                number(len(used)),
                number(max(len(residuals.of_kind(kind)) - len(used), int((out == kind).sum()))),
                *(form(factor * float(value)) for value in (a_priori, after, rms, size.max())),
            )
        )
    heads = (
        "observations",
        "unit",
        "largest at",
        "used",
        "left out",
        "sigma given" if solution.sigma_scale == 1.0 else "sigma used",
        "a posteriori",
        "RMS residual",
        "largest",
    )
    return PageTable("Observations by kind: residuals are adjusted minus observed", heads, rows, 3) if rows else None


def accuracy_table(evaluations: Mapping[str, Mapping[str, Any]]) -> PageTable | None:
    """Control, check, truth and theory of each evaluation."""
    lines = (
        ("fit to control", "RMSE", "control_points", "control_rmse_{}_m"),
        ("independent check", "RMSE", "check_points", "check_rmse_{}_m"),
        ("independent check", "bias", "check_points", "check_bias_{}_m"),
        ("truth (simulated)", "RMSE", "truth_points", "truth_rmse_{}_m"),
        ("theory", "RMS sigma", "truth_points", "theory_rmse_{}_m"),
    )
    rows, rms = [], list[float]()
    for stage, figures in evaluations.items():
        if "free_strips_models" in figures:
            continue  # strips have errors by number of the model, in their section
        for what, statistic, count, name in lines:
            values = [figures.get(name.format(axis)) for axis in "xyz"]
            if any(value is not None for value in values):
                n, sizes = int(figures.get(count) or 0), [np.nan if v is None else float(v) for v in values]
                if statistic == "bias":  # of n errors, known to RMSE / sqrt(n)
                    texts, unit = alike(sizes, max(rms, default=0.0) / max(n, 1) ** 0.5)
                else:
                    (texts, unit), rms = rms_alike(sizes, n), [size for size in sizes if size == size]
                rows.append((stage, what, statistic, unit, number(n) if n else DASH, *texts))
            elif what == "independent check" and statistic == "RMSE" and RESULTS & figures.keys():
                rows.append((stage, what, "no check points", "", DASH, DASH, DASH, DASH))
    heads = ("evaluation", "against", "figure", "unit", "points", "X", "Y", "Z")
    return PageTable("Accuracy", heads, rows, 4) if rows else None


def _of(shown: int, total: int, which: str) -> str:
    return f" ({total})" if shown == total else f" (the {shown} {which} of {total})"


def _flat(values: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in values.items():
        if isinstance(value, Mapping) and value:
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value
