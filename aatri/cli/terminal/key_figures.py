"""The key figures of runs: how far check points are off, what theory says, sigma0, what is left out, the time.

A root mean square of n independent errors is itself uncertain by its share 1 / sqrt(2 n): what differs by less is
"within chance". That is one standard deviation of one RMSE; errors of two runs at the same points are alike, so that
their difference is better known than this says. The number of independent errors is that of the evaluation, at most
the number of points; of sigma0 the redundancy. The last result comes first, then those on the way to it.
"""

import csv
import io
from collections.abc import Sequence
from itertools import chain
from typing import Any

from aatri.cli.terminal.console import say, say_table
from aatri.pipeline.plan.compare import Compared
from aatri.units import rms_alike

_OF_EVALUATIONS = (
    ("check points, RMSE", "check", "check_rmse_{}_m"),
    ("check points, theory", "", "check_theory_rmse_{}_m"),
    ("control without itself, RMSE", "left_out", "left_out_rmse_{}_m"),
    ("new points, true RMSE", "truth", "truth_rmse_{}_m"),
    ("new points, theory", "", "theory_rmse_{}_m"),
)
"""Row, the points that make it uncertain, and its figures; theory is as uncertain as sigma0, by which it is scaled."""

ROUNDING = 1e-6
"""Relative: differences below are not shown."""


def say_key_figures(runs: Sequence[Compared]) -> None:
    """Print the key figures of two runs, one table."""
    head, rows = key_figures(runs)
    say_table(head, rows, head[1:-1])
    say()


def key_figures(runs: Sequence[Compared]) -> tuple[list[str], list[list[str]]]:
    """Head and rows of the key figures; of two runs with the difference, where chance does not explain it."""
    seconds = [sum(float(r["seconds"]) for r in run.records.values()) for run in runs]
    last, *before = [_accuracy(stage, runs) for stage in reversed(_stages(runs, "Evaluation"))] or [[]]
    rows = [*last, *_of_solutions(runs), ["seconds", *(f"{s:.1f}" for s in seconds), ""], *chain.from_iterable(before)]
    head = ["key figures", *(run.name for run in runs), "difference"]
    return (head, rows) if len(runs) == 2 else (head[:-1], [row[:-1] for row in rows])


def pasted(head: Sequence[str], rows: Sequence[Sequence[str]], form: str) -> str:
    """A table to be pasted into a text (markdown) or a spreadsheet (csv)."""
    if form == "csv":
        text = io.StringIO()
        csv.writer(text, lineterminator="\n").writerows([head, *rows])
        return text.getvalue().rstrip("\n")
    cells = [[cell.replace("|", "\\|") for cell in row] for row in (head, *rows)]
    lines = [f"| {' | '.join(row)} |" for row in cells]
    return "\n".join([lines[0], f"|---|{'---:|' * (len(head) - 1)}", *lines[1:]])


def _accuracy(stage: str, runs: Sequence[Compared]) -> list[list[str]]:
    rows, figures = [], [run.records[stage]["metrics"] for run in runs]
    for what, points, pattern in _OF_EVALUATIONS:
        for axis in "xyz":
            values = [f.get(pattern.format(axis)) for f in figures]
            if None not in values:
                counts = [f.get(f"{points}_independent_{axis}") or f.get(f"{points}_points") for f in figures]
                counts = counts if points else [_redundancy(run, stage) for run in runs]
                texts, unit = rms_alike(values, min((float(n) for n in counts if n), default=0.0))
                rows.append([f"{stage}: {what} {axis.upper()} {unit}", *texts, _difference(values, counts)])
    return rows


def _redundancy(run: Compared, evaluation: str) -> float | None:
    """Of the adjustment that an evaluation judges."""
    record = run.records.get(run.records[evaluation].get("inputs", {}).get("solution", {}).get("stage", ""), {})
    figures = record.get("metrics", {})
    redundancy = figures.get("sigma0_redundancy") or figures.get("redundancy")
    return float(redundancy) if redundancy else None


def _of_solutions(runs: Sequence[Compared]) -> list[list[str]]:
    rows = []
    for stage in _stages(runs, "Solution")[-1:]:
        figures = [run.records[stage]["metrics"] for run in runs]
        for name, what, form in (("sigma0", "sigma0", ".3f"), ("suspects", "suspects", "d"), ("images", "images", "d")):
            values = [f.get(name) for f in figures]
            if None not in values:
                redundancies = [f.get("sigma0_redundancy") or f.get("redundancy") for f in figures]
                change = _difference(values, redundancies if name == "sigma0" else [])
                rows.append([f"{stage}: {what}", *(format(v, form) for v in values), change])
    return rows


def _stages(runs: Sequence[Compared], kind: str) -> list[str]:
    """Stages of a kind that all runs have."""
    return [s for s in runs[0].stages if all(_kind(run, s) == kind for run in runs)]


def _kind(run: Compared, stage: str) -> str:
    return str(run.records[stage]["output"]["kind"]) if stage in run.records else ""


def _difference(values: Sequence[Any], counts: Sequence[Any]) -> str:
    """The change of the root of a mean square of so many independent errors, and whether chance explains it."""
    text = _change(values)
    fewest = min((float(n) for n in counts if n), default=0.0)
    if not text or not fewest:
        return text
    change, chance = abs(values[1] - values[0]) / max(values), (2 * fewest) ** -0.5
    return "within chance" if change <= chance else text


def _change(values: Sequence[Any]) -> str:
    first, last = float(values[0]), float(values[-1])
    if abs(last - first) <= ROUNDING * max(abs(first), abs(last)):
        return ""
    return f"{(last - first) / abs(first):+.1%}" if first else f"{last - first:+g}"
