"""What a run says at its end: the table of its stages, its warnings, where it lies, and the judgement of its result."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from aatri.cli.terminal.console import say

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
    from aatri.cli.calibration import say_calibration
    from aatri.cli.terminal.figures import say_result

    say_result(records)
    say_calibration(folder, records)
    say()
    _say_warnings(records)
    if gates:
        say(f"gates   {sum(gate.passed for gate in gates)} of {len(gates)} passed")
    say(f"run     {folder}")
    say(f"report  {report}" if report else "report  not written, see the warning above")
    text = judgement(report.with_suffix(".json")) if report is not None else ""
    if text:
        say(f"\n{text}")


def judgement(report: Path) -> str:
    """What the report says first; empty where a report.json is of an older version, or there is none."""
    try:
        text = str(json.loads(report.read_text(encoding="utf-8"))["judgement"])
    except (OSError, ValueError, KeyError, TypeError):
        return ""
    return text.replace("\u202f", " ")  # a terminal shows thin blanks as their codes


def _say_warnings(records: Sequence[Mapping[str, Any]]) -> None:
    """Those told on the way have gone by, and of results that were there already nothing was told."""
    warnings = [f"warning: {record['stage']}: {text}" for record in records for text in record["warnings"]]
    for text in warnings[:MOST_WARNINGS]:
        say(text)
    if len(warnings) > MOST_WARNINGS:
        say(f"{len(warnings) - MOST_WARNINGS} more warnings, in the report")
    if warnings:
        say()
