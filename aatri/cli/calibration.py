"""What a run has estimated of its cameras, at its end on the terminal: values, standard deviations, correlations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aatri.cli.terminal.console import narrate, say, say_table
from aatri.ids import several

if TYPE_CHECKING:
    from aatri.artifacts.solution import Parameters, Solution

MOST_ROWS = 40
OF_IMAGES = ("film", "velocity")
"""Groups whose parameters are those of single images: hundreds, which are counted."""
STRONG = 0.9
"""Correlations from here on are told."""


def say_calibration(run: Path, records: Sequence[Mapping[str, Any]]) -> None:
    """Print what the last Solution estimated of cameras and sets; parameters of single images are counted."""
    solutions = [r for r in records if r.get("output", {}).get("kind") == "Solution"]
    if not solutions or not solutions[-1]["output"].get("rows", {}).get("parameters", 1):
        return
    stage = solutions[-1]["stage"]
    from aatri.artifacts.solution import Solution
    from aatri.errors import AatriError
    from aatri.pipeline.store import run_folder as store
    from aatri.tables.hdf5 import read

    try:
        shown = ("parameters", "parameter_covariances", "calibrated_sets")
        solution = read(store.artifact_path(run, stage), Solution, shown)
    except AatriError as error:
        narrate(f"warning: {error}")
        return
    say_parameters(stage, solution)


def say_parameters(stage: str, solution: Solution) -> None:
    """The table of parameters that were estimated, and pairs that the data hardly separate."""
    from aatri.formats.results.parameter_units import parameter_units
    from aatri.formats.results.solution_tables import removed_parameters
    from aatri.report.view.numbers import estimate

    p, units, removed = solution.parameters, parameter_units(solution), removed_parameters(solution.parameters)
    estimated = [k for k in range(len(p)) if removed[k] or p.sigma[k] != 0]
    rows = [k for k in estimated if p.group[k] not in OF_IMAGES]
    if not rows:
        return
    cells = [
        [
            f"{p.object[k]} {p.name[k]}",
            *(("removed", "", units[k]) if removed[k] else estimate(float(p.value[k]), float(p.sigma[k]), units[k])),
        ]
        for k in rows[:MOST_ROWS]
    ]
    say()
    say_table((f"{stage}: parameters", "value", "sigma", "unit"), cells, ("value", "sigma"))
    left_off = [(len(rows[MOST_ROWS:]), "more"), (len(estimated) - len(rows), "of single images")]
    if counts := [f"{count} {which}" for count, which in left_off if count]:
        say(f"{', '.join(counts)}: aatri show RUN:{stage} parameters --all")
    for text in _strong(solution):
        say(text)


def _strong(solution: Solution) -> list[str]:
    import numpy as np

    p, c = solution.parameters, solution.parameter_covariances
    if c is None or not len(c):
        return []
    with np.errstate(divide="ignore", invalid="ignore"):
        r = c.covariance / (p.sigma[c.first] * p.sigma[c.second])
    pairs = np.flatnonzero((c.first != c.second) & (np.abs(np.nan_to_num(r)) >= STRONG))
    lines = [
        f"{p.object[c.first[k]]}: {p.name[c.first[k]]} and {p.name[c.second[k]]}{_of(p, c.first[k], c.second[k])} "
        f"correlate by {r[k]:.3f}"
        for k in pairs[np.argsort(-np.abs(r[pairs]), kind="stable")][:MOST_ROWS].tolist()
    ]
    if len(pairs) > MOST_ROWS:
        lines.append(f"{several(len(pairs) - MOST_ROWS, 'further correlation')} of {STRONG} and more")
    return lines


def _of(p: Parameters, first: int, second: int) -> str:
    return "" if p.object[first] == p.object[second] else f" of {p.object[second]}"
