"""How figures of stages are shown: one line while running, a table and the accuracy at the end."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from aatri.cli.terminal.console import say, say_table
from aatri.units import of_model, rms_alike

_HIGHLIGHTS = (
    "images",
    "models",
    "strips",
    "points",
    "sigma0",
    "sigma0_um",
    "check_points",
    "check_rmse_x_m",
    "check_rmse_y_m",
    "check_rmse_z_m",
    "image_points",
    "suspects",
)
_MOST = 4
MISSING = "-"

_ACCURACY = {
    "control": "RMS of the differences at control points",
    "check": "RMS of the differences at check points",
    "truth": "RMS of the differences to the truth, new points",
    "theory": "RMS of the theoretical standard deviations, new points",
}


def highlights(metrics: Mapping[str, Any]) -> str:
    """The figures that matter most, in a line."""
    names = [name for name in _HIGHLIGHTS if name in metrics] or list(metrics)
    return ", ".join(f"{name} {number(metrics[name])}" for name in names[:_MOST])


def number(value: Any) -> str:
    """A figure as text; `-` if it was not determined."""
    if value is None:
        return MISSING
    return f"{value:.4g}" if isinstance(value, float) else f"{value}"


def say_result(records: Sequence[Mapping[str, Any]], *, metric: bool = True) -> None:
    """The table of stages, and the accuracy of every evaluation; `metric`: something gives the scale."""
    rows = []
    for record in records:
        metrics = record["metrics"]
        counts = [number(metrics[name]) if name in metrics else "" for name in ("images", "points")]
        sigma0 = f"{metrics['sigma0']:.3f}" if isinstance(metrics.get("sigma0"), float) else ""
        rows.append([record["stage"], record["plugin"], *counts, sigma0, f"{record['seconds']:.2f}"])
    say_table(
        ("stage", "method", "images", "points", "sigma0", "seconds"), rows, ("images", "points", "sigma0", "seconds")
    )
    for record in records:
        _say_accuracy(record, metric)


def _say_accuracy(record: Mapping[str, Any], metric: bool) -> None:
    metrics = record["metrics"]
    rows = []
    for group, meaning in _ACCURACY.items():
        values = [metrics.get(f"{group}_rmse_{axis}_m") for axis in "xyz"]
        if any(value is not None for value in values):
            count = int(metrics.get(f"{'truth' if group == 'theory' else group}_points") or 0)
            lengths = [math.nan if value is None else float(value) for value in values]
            texts, unit = rms_alike(lengths, count) if metric else of_model(lengths)
            rows.append([meaning + (f" ({count})" if count else ""), unit, *texts])
    if rows:
        say()
        solution = record["inputs"].get("solution", {}).get("stage", "")
        say_table((f"{record['stage']}: of {solution}", "unit", "X", "Y", "Z"), rows, "XYZ")
