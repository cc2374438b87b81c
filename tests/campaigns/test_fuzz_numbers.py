"""The oracle of numbers: what it takes for a number, that sound readers pass it, and that a loosened one does not."""

from __future__ import annotations

import random
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from aatri import strict_yaml
from aatri.formats.colmap import text as colmap_text
from aatri.formats.text import csv_table, number_text
from tests.campaigns.fuzz_numbers import Numbers
from tests.campaigns.fuzz_programs import OF_OTHER_PROGRAMS
from tests.campaigns.fuzz_seeds import OF_BLOCKS, READERS, Reader
from tests.campaigns.number_texts import WRONG, meaning

COUNT = 20


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
    assert meaning("007", ".yaml") is None
    assert [meaning(text, ".json") for text in ("+5", "5.", ".5", "05", "5.0e+2")] == [None, None, None, None, 500.0]


def test_what_means_no_number_means_none() -> None:
    for old in ("12.5", "-7", "1e-3", "4505079.577"):
        assert all(meaning(write(old)) is None for write in WRONG)


def numbers_of(reader: Reader, folder: Path) -> Numbers:
    reader.write(folder)
    return Numbers(reader, folder, {file: (folder / file).read_bytes() for file in reader.files})


@pytest.fixture(params=OF_BLOCKS)
def numbers(request: pytest.FixtureRequest, tmp_path: Path) -> Numbers:
    return numbers_of(READERS[request.param], tmp_path)


def complaints(numbers: Numbers, count: int = COUNT) -> Iterator[str]:
    chance = random.Random("numbers")
    return (said for _ in range(count) if (said := numbers.wrong(chance)))


@pytest.mark.slow(after=3)
def test_the_numbers_of_every_reader_are_taken_rightly_or_refused_with_their_line(numbers: Numbers) -> None:
    assert list(complaints(numbers)) == []
    looked_at = list(numbers.cells.values())
    assert sum(cell is not None for cell in looked_at) >= 5


@pytest.mark.slow(after=3)
@pytest.mark.parametrize("name", OF_OTHER_PROGRAMS)
def test_numbers_of_other_programs_are_taken_rightly_or_refused_with_their_line(tmp_path: Path, name: str) -> None:
    numbers = numbers_of(OF_OTHER_PROGRAMS[name], tmp_path)
    assert list(complaints(numbers)) == []
    assert any(cell is not None for cell in numbers.cells.values())


@pytest.mark.slow(after=3)
def test_a_loosened_parser_is_found_out(numbers: Numbers, monkeypatch: pytest.MonkeyPatch) -> None:
    anything = re.compile(r"(?s).+")
    monkeypatch.setattr(number_text, "_NUMBER", anything)
    monkeypatch.setattr(number_text, "_FOREIGN", re.compile(r"(?!)"))
    for module in (number_text, csv_table, colmap_text):  # it asks the loosened pattern whether a text is a number
        monkeypatch.setattr(module, "what_is_wrong", lambda _: "not a number")
    of_yaml = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(_[0-9]+)*(\.[0-9]*(_[0-9]+)?)?)([eE][-+]?[0-9]+)?")
    monkeypatch.setattr(strict_yaml, "_FLOAT", of_yaml)
    assert any(complaints(numbers, 400))
