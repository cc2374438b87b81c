"""The oracle of numbers: what it takes for a number, that sound readers pass it, and that a loosened one does not."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest

from aatri import strict_yaml
from aatri.formats.text import number_text
from tests.campaigns.fuzz_numbers import WRONG, Numbers, meaning
from tests.campaigns.fuzz_seeds import OF_BLOCKS, READERS

COUNT = 120


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("12", 12.0),
        ("-12.5", -12.5),
        ("+.5", 0.5),
        ("5.", 5.0),
        ("1e3", 1000.0),
        ("-1.25E-02", -0.0125),
        ("007", 7.0),
        ("", None),
        (".", None),
        ("e5", None),
        ("1e", None),
        ("1_0", None),
        ("1,5", None),
        ("87-", None),
        ("１", None),
        ("1e999", None),
        ("nan", None),
        ("0x1F", None),
        ("1 2", None),
    ],
)
def test_the_meaning_of_a_text(text: str, value: float | None) -> None:
    assert meaning(text) == value
    assert meaning("007", yaml=True) is None


def test_what_means_no_number_means_none() -> None:
    for old in ("12.5", "-7", "1e-3", "4505079.577"):
        assert all(meaning(write(old)) is None for write in WRONG)


@pytest.fixture(params=OF_BLOCKS)
def numbers(request: pytest.FixtureRequest, tmp_path: Path) -> Numbers:
    reader = READERS[request.param]
    reader.write(tmp_path)
    good = {file: (tmp_path / file).read_bytes() for file in reader.files}
    return Numbers(request.param, tmp_path, good)


def complaints(numbers: Numbers, seed: str = "numbers") -> list[str]:
    chance = random.Random(seed)
    return [said for _ in range(COUNT) if (said := numbers.wrong(chance))]


def test_the_numbers_of_every_reader_are_taken_rightly_or_refused_with_their_line(numbers: Numbers) -> None:
    assert complaints(numbers) == []
    looked_at = list(numbers.cells.values())
    assert sum(cell is not None for cell in looked_at) >= 5


def test_a_loosened_parser_is_found_out(numbers: Numbers, monkeypatch: pytest.MonkeyPatch) -> None:
    anything = re.compile(r"(?s).+")
    monkeypatch.setattr(number_text, "_NUMBER", anything)
    monkeypatch.setattr(number_text, "_FOREIGN", re.compile(r"(?!)"))
    of_yaml = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(_[0-9]+)*(\.[0-9]*(_[0-9]+)?)?)([eE][-+]?[0-9]+)?")
    monkeypatch.setattr(strict_yaml, "_FLOAT", of_yaml)
    assert any(complaints(numbers, f"{k}") for k in range(10))
