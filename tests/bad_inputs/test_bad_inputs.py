"""Every bad input of the tables of this folder is answered with the message beside it.

pytest tests/bad_inputs -k row_081                the rows of one number, or of one word
APPROVE=1 pytest tests/bad_inputs        writes the messages anew; read the difference before you commit it
"""

from __future__ import annotations

import math
import os
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from aatri.cli.main import app
from tests.bad_inputs.rows import KEYS, BadInput, all_rows

ROWS = all_rows()


@pytest.mark.parametrize(
    "row", [pytest.param(row, id=row.id, marks=[pytest.mark.slow] if row.row.get("slow") else []) for row in ROWS]
)
def test_a_bad_input_is_answered_with_the_approved_message(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, row: BadInput
) -> None:
    monkeypatch.chdir(tmp_path)
    arguments = row.write(tmp_path)
    monkeypatch.setattr("sys.argv", ["aatri", *arguments])
    done = CliRunner().invoke(app, arguments)
    told = f"exit {done.exit_code}\n{done.stderr.replace(str(tmp_path), '.')}"
    told = re.sub(r"[0-9]+\.[0-9]+ s\b", "N s", told)
    told += _log(tmp_path, str(row.row.get("shows", "")))
    if row.row.get("masked"):
        told = re.sub("#(?:, #)+", "#, ...", told[:7] + _MASKED.sub("#", told[7:]))
    elif row.is_computed:
        told = _as_approved(_in_short(told), row.approved)
    if os.environ.get("APPROVE"):
        row.approve(told)
    else:
        assert told == row.approved
    assert "internal error" not in told
    assert done.exit_code != 1


_MASKED = re.compile(r"[0-9][0-9./]*(?:e[-+]?[0-9]+)?")
"""Figures and ids of what has not converged: they differ from machine to machine."""
_FIGURE = re.compile(r"(?<![\w.:-])-?[0-9]+\.[0-9]+(?:e[-+]?[0-9]+)?")
_ROUNDED = re.compile(r"(?<![\w.:/-])-?[0-9]+(?:\.[0-9]+)?(?:e[-+]?[0-9]+)?(?![\w/:])")


def _in_short(text: str) -> str:
    """The text with computed figures in two digits: a better weight or another order of sums changes the third."""
    return _FIGURE.sub(lambda m: f"{float(m.group()):.2g}", text)


def _as_approved(told: str, approved: str) -> str:
    """The text with the approved figures where its own are as near as rounding leaves them: one of the second digit."""
    expected = _ROUNDED.findall(approved)
    if _ROUNDED.split(told) != _ROUNDED.split(approved):
        return told
    figures = iter(expected)

    def near(match: re.Match[str]) -> str:
        value, other = float(match.group()), next(figures)
        unit = 10.0 ** (math.floor(math.log10(abs(value))) - 1) if value else 0.0
        computed = re.search("[.e]", match.group() + other) or told[: match.start()].endswith("sigma0 is ")
        return other if computed and abs(value - float(other)) <= 1.01 * unit else match.group()

    return _ROUNDED.sub(near, told)


def test_figures_may_differ_by_one_of_the_second_digit_and_counts_by_nothing() -> None:
    assert (
        _as_approved("3 of 8: 7.9 sigma, 0101/GCP1", "3 of 8: 7.8 sigma, 0101/GCP1") == "3 of 8: 7.8 sigma, 0101/GCP1"
    )
    for told, approved in (("4 of 8", "3 of 8"), ("8.1 mm", "7.8 mm"), ("0101/GCP1 7.8", "0101/GCP2 7.8")):
        assert _as_approved(told, approved) == told


def _log(folder: Path, stage: str) -> str:
    """What a stage has put into its log, without times, figures of speed and size; of recipes that ask for it."""
    text = "".join(path.read_text() for path in folder.glob(f"out/objects/{stage}/*/stage.log")) if stage else ""
    lines = [line.split(maxsplit=1)[1] for line in text.splitlines() if len(line.split()) > 1]
    kept = [line for line in lines if not re.match(r"[0-9]+ unknowns|memory|iteration|auto,|.*bandwidth|warning", line)]
    return "".join(f"log of {stage}: {line}\n" for line in kept)


def test_rows_have_an_id_of_their_own_and_no_unknown_keys() -> None:
    ids = [row.id for row in ROWS]
    assert len(set(ids)) == len(ids)
    for row in ROWS:
        assert re.fullmatch(r"row_\d{3}_[a-z0-9_]+", row.id)
        assert row.row["what"]
        assert set(row.row) <= KEYS
