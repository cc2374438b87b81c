"""What a run says at its end: the table of its stages, its warnings, where it lies, and the judgement of its result.

Before it, what the run has estimated of its cameras: values, standard deviations, correlations.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aatri.cli.terminal.console import narrate, say, say_table
from aatri.ids import several
from aatri.notes import CONTRADICTION
from aatri.units import METRES_OF_MODEL

if TYPE_CHECKING:
    from aatri.artifacts.solution import Parameters, Solution

MOST_ROWS = 40
OF_IMAGES = ("film", "velocity")
"""Groups whose parameters are those of single images: hundreds, which are counted."""
STRONG = 0.9
"""Correlations from here on are told."""

MOST_WARNINGS = 10
"""So many are shown at the end; the report has all."""


def say_end(folder: Path, records: Sequence[Mapping[str, Any]], report: Path | None, gates: Sequence[Any]) -> None:
    """The result of a run.

    Parameters
    ----------
    folder : Path
        Of the run.
    records : sequence of mapping
        Of its stages.
    report : Path, optional
    gates : sequence of Verdict
    """
    from aatri.cli.terminal.figures import say_result

    page = _first_page(report.with_suffix(".json")) if report is not None else {}
    say_result(records, metric=METRES_OF_MODEL not in page.get("facts", {}))
    say_calibration(folder, records)
    say()
    text = page.get("judgement", "")
    _say_problems(page.get("problems", ()), text, refused=not all(gate.passed for gate in gates))
    if gates:
        say(f"gates   {sum(gate.passed for gate in gates)} of {len(gates)} passed")
    say(f"run     {folder}")
    say(f"report  {report}" if report else "report  not written, see the warning above")
    if text:
        say(f"\n{text}")


def judgement(report: Path) -> str:
    """What the report says first."""
    return str(_first_page(report).get("judgement", ""))


def _first_page(report: Path) -> dict[str, Any]:
    """What report.json says; empty where it is of an older version, or there is none."""
    try:
        text = report.read_text(encoding="utf-8").replace("\\u202f", " ")  # a terminal shows thin blanks as their codes
        page = json.loads(text)
    except (OSError, ValueError):
        return {}
    return page if isinstance(page, dict) and "judgement" in page else {}


def _say_problems(problems: Sequence[Mapping[str, str]], judged: str, *, refused: bool) -> None:
    """Warnings that bear on the result, as the first page has them.

    They went by with their stages, or were there already; what the judgement or the error of a gate says is left to it.
    """
    texts = [
        f"warning: {problem['stage']}: {problem['text']}"
        for problem in problems
        if problem["stage"]
        and not _is_in_judgement(problem["text"], judged)
        and not (refused and CONTRADICTION in problem["text"])
    ]
    for text in texts[:MOST_WARNINGS]:
        say(text)
    if len(texts) > MOST_WARNINGS:
        say(f"{several(len(texts) - MOST_WARNINGS, 'more warning')}, in the report")
    if texts:
        say()


def _is_in_judgement(text: str, judged: str) -> bool:
    """Whether the judgement has it: as it is, or as a list of the same head that names fewer."""
    head, colon, _ = text.partition(": ")
    return text in judged or (bool(colon) and f"{head}: " in judged)


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
