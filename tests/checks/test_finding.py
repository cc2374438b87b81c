"""What a check has found, in words, and how it is reported."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import aatri.checks
from aatri.checks.finding import Finding, report
from aatri.errors import GeometryError, InputError

ROOM = Path(aatri.checks.__file__).parent


class Heard:
    """A reporter that keeps what it is told."""

    def __init__(self) -> None:
        self.said: list[tuple[str, str]] = []

    def log(self, text: str, **_values: object) -> None:
        self.said.append(("note", text))

    def warn(self, text: str, **_values: object) -> None:
        self.said.append(("warning", text))


def test_a_finding_is_place_sentence_names_alternatives_remedy() -> None:
    found = Finding(
        "units",
        "warning",
        "heights are in feet",
        "convert them",
        ids=("7", "9"),
        where="control.csv:3",
        alternatives=("a wrong lens",),
    )
    assert str(found) == "control.csv:3: heights are in feet: 7, 9; a wrong lens would explain as much; convert them"


def test_errors_are_raised_after_everything_was_said() -> None:
    heard = Heard()
    error = Finding("datum", "error", "no datum", "give control", error=GeometryError)
    with pytest.raises(GeometryError, match="no datum") as raised:
        report([error, Finding("figures", "note", "a"), Finding("units", "warning", "b", "c")], heard)  # type: ignore[arg-type]
    assert raised.value.remedy == "give control"
    assert heard.said == [("note", "a"), ("warning", "b; c")]
    assert Finding("units", "error", "x").error is InputError


def test_the_cause_of_a_finding_is_the_name_of_its_file() -> None:
    """Whoever reads a message finds the check."""
    causes = {
        (path.stem, call.args[0].value)
        for path in ROOM.rglob("*.py")
        for call in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(call, ast.Call) and getattr(call.func, "id", "") == "Finding"
        if call.args and isinstance(call.args[0], ast.Constant)
    }
    assert {pair for pair in causes if pair[0] != pair[1]} == set()


def test_a_check_says_one_cause_in_a_file_that_says_what_is_seen_and_the_test() -> None:
    saying = [path for path in ROOM.glob("*/[!_]*.py") if "Finding(" in path.read_text(encoding="utf-8")]
    for path in saying:
        head = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
        assert [word for word in ("Seen:", "Test:") if word not in head] == [], path.name
