"""Tables of the page: heads and rows of text; what is long is cut, and the caption says so."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from aatri.artifacts.block import Rejects
from aatri.artifacts.evaluation import Evaluation
from aatri.artifacts.solution import Solution
from aatri.artifacts.suspects import Suspects
from aatri.report.numbers import DASH, metres, number

MOST_ROWS = 20
_AXIS = re.compile(r"_([xyz])(_|$)")


@dataclass(frozen=True)
class PageTable:
    """A table: `text_columns` leading columns are text, the others numbers; `folded` shows only its caption."""

    caption: str
    heads: Sequence[str]
    rows: Sequence[Sequence[str]]
    text_columns: int = 1
    folded: bool = False


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


def suspects_table(suspects: Suspects) -> PageTable | None:
    """The worst suspects, largest test statistic first."""
    if not len(suspects):
        return None
    order = np.argsort(-np.abs(np.nan_to_num(suspects.test)), kind="stable")[:MOST_ROWS]
    rows = [
        (
            str(suspects.kind[k]), str(suspects.image[k]) or DASH, str(suspects.point[k]) or DASH,
            str(suspects.verdict[k]), str(suspects.stage[k]), str(suspects.unit[k]),
            number(float(suspects.size[k])), number(float(suspects.sigma[k])), number(float(suspects.test[k])),
        )
        for k in order
    ]  # fmt: skip
    heads = ("observation", "image", "point", "verdict", "tested by", "unit", "size", "sigma", "test")
    return PageTable(f"Suspects{_of(len(rows), len(suspects), 'worst')}", heads, rows, text_columns=6)


def rejects_table(rejects: Rejects) -> PageTable | None:
    """What was set aside on import."""
    if not len(rejects):
        return None
    rows = [
        (str(rejects.kind[k]), str(rejects.id[k]), str(rejects.reason[k])) for k in range(min(MOST_ROWS, len(rejects)))
    ]
    return PageTable(f"Set aside on import{_of(len(rows), len(rejects), 'first')}", ("what", "id", "why"), rows, 3)


def first_rows(caption: str, table: Any, columns: Mapping[str, Callable[[int], str]], texts: int) -> PageTable | None:
    """The first rows of any table; `columns` maps a head to the cell of a row."""
    if not len(table):
        return None
    shown = min(MOST_ROWS, len(table))
    rows = [tuple(cell(k) for cell in columns.values()) for k in range(shown)]
    return PageTable(f"{caption}{_of(shown, len(table), 'first')}", tuple(columns), rows, texts)


def residual_classes(solution: Solution) -> PageTable | None:
    """Residuals by kind of observation: number, RMS, RMS over a priori standard deviation, largest and where."""
    residuals = solution.residuals
    rows = []
    for kind in np.unique(residuals.kind):
        used = np.flatnonzero((residuals.kind == kind) & residuals.active)
        if not len(used):
            continue
        v, sigma = residuals.residual[used], residuals.sigma[used]
        factor, unit = (1e3, "um") if kind == "image_point" else (1e3, "mm")
        known = np.isfinite(v)
        weighted = known & (np.nan_to_num(sigma) > 0)
        size = np.where(known, np.abs(v), -1.0).max(axis=1)
        worst = used[int(np.argmax(size))]
        where = " / ".join(filter(None, (str(residuals.image[worst]), str(residuals.point[worst]))))
        normalised = float(np.sqrt(np.mean((v[weighted] / sigma[weighted]) ** 2))) if weighted.any() else None
        rows.append((
            str(kind), unit, where or DASH, number(len(used)), number(int((residuals.kind == kind).sum() - len(used))),
            number(factor * float(np.sqrt(np.mean(v[known] ** 2)))) if known.any() else DASH,
            number(normalised), number(factor * float(size.max())),
        ))  # fmt: skip
    heads = ("observations", "unit", "largest at", "used", "rejected", "RMS residual", "RMS of v / sigma", "largest")
    return PageTable("Residuals (adjusted minus observed) by kind", heads, rows, 3) if rows else None


def accuracy_table(evaluations: Mapping[str, Mapping[str, Any]]) -> PageTable | None:
    """Control, check, truth and theory of each evaluation, in metres.

    Parameters
    ----------
    evaluations : {stage: metrics}
    """
    lines = (
        ("fit to control", "RMSE", "control_points", "control_rmse_{}_m"),
        ("independent check", "RMSE", "check_points", "check_rmse_{}_m"),
        ("independent check", "bias", "check_points", "check_bias_{}_m"),
        ("truth (simulated)", "RMSE", "truth_points", "truth_rmse_{}_m"),
        ("theory", "RMS sigma", "truth_points", "theory_rmse_{}_m"),
    )
    rows = []
    for stage, figures in evaluations.items():
        for what, statistic, count, name in lines:
            values = [figures.get(name.format(axis)) for axis in "xyz"]
            if any(value is not None for value in values):
                n = number(figures.get(count)) if figures.get(count) else DASH
                rows.append((stage, what, statistic, n, *(metres(value) for value in values)))
            elif what == "independent check" and statistic == "RMSE":
                rows.append((stage, what, "no check points", DASH, DASH, DASH, DASH))
    heads = ("evaluation", "against", "figure", "points", "X m", "Y m", "Z m")
    return PageTable("Accuracy", heads, rows, 3) if rows else None


def point_tables(evaluation: Evaluation) -> list[PageTable]:
    """Differences at single control and check points, the largest first."""
    tables = []
    differences = evaluation.differences
    for kind in ("control", "check"):
        rows = np.flatnonzero(differences.kind == kind)
        if not len(rows):
            continue
        size = np.nan_to_num(np.abs(differences.difference_m[rows])).max(axis=1)
        worst = rows[np.argsort(-size, kind="stable")[:MOST_ROWS]]
        cells = [
            (
                str(differences.point[k]),
                *(metres(float(d)) for d in differences.difference_m[k]),
                *(metres(float(s)) for s in differences.sigma_m[k]),
                number(int(differences.rays[k])),
            )
            for k in worst
        ]
        heads = ("point", "dX m", "dY m", "dZ m", "sX m", "sY m", "sZ m", "rays")
        what = f"Differences at {kind} points{_of(len(cells), len(rows), 'largest')}"
        tables.append(PageTable(what, heads, cells))
    return tables


def _of(shown: int, total: int, which: str) -> str:
    return f" ({total})" if shown == total else f" (the {shown} {which} of {total})"


def _flat(values: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in values.items():
        if isinstance(value, Mapping) and value:
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value
