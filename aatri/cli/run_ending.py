"""What a run says at its end: the table of its stages, its warnings, where it lies, and the judgement of its result.

Before it, what the run has estimated of its cameras. All of it but the table of stages is on the first page of the
report, so that a run that has nothing to do reads no artifact.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from aatri.cli.terminal.console import say, say_table
from aatri.ids import several
from aatri.notes import CONTRADICTION
from aatri.units import METRES_OF_MODEL

MOST_WARNINGS = 10
"""So many are shown at the end; the report has all."""


def say_end(
    folder: Path,
    records: Sequence[Mapping[str, Any]],
    report: Path | None,
    gates: Sequence[Any],
    above: Sequence[tuple[str, str]] = (),
) -> None:
    """The result of a run.

    Parameters
    ----------
    folder : Path
        Of the run.
    records : sequence of mapping
        Of its stages.
    report : Path, optional
    above : sequence of (stage, warning)
        What stands above on the same terminal, and is counted.
    """
    from aatri.cli.terminal.figures import say_result

    page = _first_page(report.with_suffix(".json")) if report is not None else {}
    of_model = page.get("facts", {}).get(METRES_OF_MODEL)
    say_result(records, metric=of_model is None)
    say_parameters(page.get("parameters", {}))
    say()
    text = page.get("judgement", "")
    problems = page.get("problems", ())
    _say_problems(problems, text, above, refused=not all(gate.passed for gate in gates))
    reading = next((r for r in records if r["plugin"].startswith("block/") and r["plugin"] != "block/tables"), None)
    if reading is not None and any(table in p["text"] for p in problems for table in ("block.yaml", ".csv")):
        say(f"tables  block.yaml, images.csv ... of this block: aatri export {folder}:{reading['stage']} tables FOLDER")
    if gates:
        say(f"gates   {sum(gate.passed for gate in gates)} of {len(gates)} passed")
    say(f"run     {folder}")
    say(f"report  {report}" if report else "report  not written, see the warning above")
    if text:
        say(f"\n{text}")
    if of_model is not None:
        say(f"{METRES_OF_MODEL} in warnings are {of_model}.")


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


def _say_problems(
    problems: Sequence[Mapping[str, str]], judged: str, above: Sequence[tuple[str, str]], *, refused: bool
) -> None:
    """Warnings that bear on the result, as the first page has them.

    They went by with their stages, or were there already; what the judgement or the error of a gate says is left to it.
    """
    narrated = _in_words(above) if above else set()
    texts = [
        f"warning: {problem['stage']}: {problem['text']}"
        for problem in problems
        if problem["stage"]
        and (problem["stage"], problem["text"]) not in narrated
        and not _is_in_judgement(problem["text"], judged)
        and not (refused and CONTRADICTION in problem["text"])
    ]
    for text in texts[:MOST_WARNINGS]:
        say(text)
    if len(texts) > MOST_WARNINGS:
        say(f"{several(len(texts) - MOST_WARNINGS, 'more warning')}, in the report")
    if above:
        say(f"{several(len(above), 'warning')} above")
    if texts or above:
        say()


def _in_words(warnings: Sequence[tuple[str, str]]) -> set[tuple[str, str]]:
    """Stages and warnings as the first page has them."""
    from aatri.report.problems import in_words

    return {(stage, in_words(text)) for stage, text in warnings}


def _is_in_judgement(text: str, judged: str) -> bool:
    """Whether the judgement has it: as it is, or as a list of the same head that names fewer."""
    head, colon, _ = text.partition(": ")
    return text in judged or (bool(colon) and f"{head}: " in judged)


def say_parameters(estimated: Mapping[str, Any]) -> None:
    """The table of parameters that the last Solution estimated, and pairs that the data hardly separate."""
    if not estimated:
        return
    say()
    say_table((f"{estimated['stage']}: parameters", "value", "sigma", "unit"), estimated["rows"], ("value", "sigma"))
    if estimated["left_off"]:
        say(f"{estimated['left_off']}: aatri show RUN:{estimated['stage']} parameters --all")
    for text in estimated["correlations"]:
        say(text)
