"""Many runs side by side: accuracies, theory and seconds of each; then what each group of runs changes, most first."""

from collections.abc import Sequence
from typing import Any

from aatri.cli.terminal.console import say, say_table
from aatri.pipeline.plan.compare import (
    Axis,
    Compared,
    axes,
    changed_settings,
    metric_rows,
    relative_spread,
    seconds_until,
)

_ACCURACY = {
    "check": "check_rmse_{}_m",
    "check theory": "check_theory_rmse_{}_m",
    "truth": "truth_rmse_{}_m",
    "theory": "theory_rmse_{}_m",
}
"""Columns of the accuracies, in plan and in height, and the figures they are made of."""

_FIGURES_OF_AN_AXIS = 6


def say_side_by_side(runs: Sequence[Compared]) -> None:
    """Tables of more than two runs."""
    judged = [s for s in runs[0].stages if any(_accuracies(r.records[s]["metrics"]) for r in runs if s in r.records)]
    for stage in judged:
        _say_accuracies(stage, runs)
    for axis in axes(runs):
        _say_axis(axis, runs[0], judged)


def _say_accuracies(stage: str, runs: Sequence[Compared]) -> None:
    """One evaluation of every run; runs that give what the first gives stand in one line."""
    cells = {run.name: _accuracies(run.records[stage]["metrics"]) if stage in run.records else None for run in runs}
    heads = [f"{group} {part}" for group in _ACCURACY for part in ("XY", "Z")]
    names = [n for n in heads if any(c and n in c for c in cells.values())]
    rows, same, first = [], [], cells[runs[0].name]
    for run in runs:
        own = cells[run.name]
        if own is None:
            rows.append([run.name, *("-" for _ in names), "-"])
        elif run is not runs[0] and own == first:
            same.append(run.name)
        else:
            rows.append([run.name, *(own.get(n, "-") for n in names), f"{seconds_until(run, stage):.2f}"])
    source = next(r.records[stage]["inputs"].get("solution", {}).get("stage", "") for r in runs if stage in r.records)
    head = (f"{stage}{f': of {source}' if source else ''}, RMS in mm", *names, "seconds")
    say_table(head, rows, (*names, "seconds"))
    if same:
        say(f"as {runs[0].name}: {', '.join(same)}")
    say()


def _accuracies(metrics: Any) -> dict[str, str]:
    """Cells of a row: plan is the root of the mean square of X and Y."""
    accuracies = {}
    for group, pattern in _ACCURACY.items():
        x, y, z = (metrics.get(pattern.format(axis)) for axis in "xyz")
        if x is not None and y is not None:
            accuracies[f"{group} XY"] = f"{1e3 * ((x * x + y * y) / 2) ** 0.5:.1f}"
        if z is not None:
            accuracies[f"{group} Z"] = f"{1e3 * z:.1f}"
    return accuracies


def _say_axis(axis: Axis, first: Compared, judged: Sequence[str]) -> None:
    """The settings that the runs of an axis change, and the figures that change most with them."""
    say(f"{', '.join(axis.stages) or 'the same options'}: {len(axis.runs)} run{'s' * (len(axis.runs) != 1)}")
    for run in axis.runs:
        say(f"  {run.name}: {'; '.join(changed_settings(first, run, axis.runs)) or 'the same options'}")
    together = (first, *axis.runs)
    once: dict[tuple[str, ...], tuple[str, list[Any]]] = {}  # what a stage passes on as it is stands once
    for name, row in metric_rows(together):
        stage, _, figure = name.partition(".")
        if stage not in judged and None not in row and len(set(map(shown_value, row))) > 1:
            once.setdefault((figure, *map(shown_value, row)), (name, row))
    rows = list(once.values())
    rows.sort(key=lambda pair: -relative_spread(pair[1]))
    if rows:
        names = [run.name for run in together]
        best = rows[:_FIGURES_OF_AN_AXIS]
        say_table(("  figure", *names), [[f"  {name}", *map(shown_value, row)] for name, row in best], names)
    if len(rows) > _FIGURES_OF_AN_AXIS:
        say(f"  {len(rows) - _FIGURES_OF_AN_AXIS} more change by less: --all")
    say()


def shown_value(value: Any) -> str:
    """A figure or an option as text."""
    if value is None:
        return "-"
    if isinstance(value, dict):
        return ", ".join(f"{name} {shown_value(each)}" for name, each in value.items())
    return f"{value:.6g}" if isinstance(value, float) else str(value)
