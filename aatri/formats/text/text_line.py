"""A line of a text file of words or cells: its words, and where it stands."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, TypeVar

from aatri.errors import InputError
from aatri.formats.text.number_text import number_of
from aatri.formats.text.text_file import read_lines
from aatri.ids import clipped, several
from aatri.progress import SILENT, Reporter

_BLANKS = r" \t\n\v\f\r"
_BLANK_FREE = re.compile(f"[^{_BLANKS}]+")
PlaceT = TypeVar("PlaceT", bound="ReadAt")
_WORD = re.compile(rf'"[^"]*"(?=[{_BLANKS}]|$)|[^{_BLANKS}]+')


class ReadAt(Protocol):
    """Whatever stands in a line of a file."""

    @property
    def path(self) -> Path:
        """The file."""

    @property
    def line(self) -> int:
        """From 1."""


def where_of(at: ReadAt) -> str:
    """`file:line`."""
    return f"{at.path}:{at.line}"


def error_at(at: ReadAt, what: str, remedy: str = "") -> InputError:
    """An error at a line."""
    return InputError(what, where=where_of(at), remedy=remedy)


@dataclass(frozen=True)
class TextLine:
    """The words of a line, and where it stands."""

    words: list[str]
    path: Path
    line: int

    where = property(where_of)
    error = error_at

    def number(self, k: int) -> float:
        """The word as a number."""
        if k >= len(self.words):
            raise self.error(several(len(self.words), "word"), f"word {k + 1} is to be a number")
        try:
            return number_of(self.words[k])
        except ValueError as error:
            raise self.error(f"{clipped(self.words[k])!r}: {error}", "write it like -1234.5") from error

    def numbers(self, first: int = 0, last: int | None = None) -> list[float]:
        """The words from one to before another as numbers."""
        return [self.number(k) for k in range(first, len(self.words) if last is None else last)]

    def of_width(self, width: int, what: str) -> TextLine:
        """The line, of so many words."""
        if len(self.words) != width:
            raise self.error(f"{several(len(self.words), 'word')} where {what} should stand", f"write {width} of them")
        return self

    def once(self, name: str, first: dict[str, TextLine], what: str, remedy: str = "remove one") -> str:
        """A name that stands once among those of its kind, whose lines are kept in `first`."""
        once(self, name, first, what, remedy)
        return name

    def count(self, k: int) -> int:
        """The word as a whole number, not negative."""
        if not (self.words[k].isascii() and self.words[k].isdigit() and len(self.words[k]) < 9):
            raise self.error(f"{clipped(self.words[k])!r} is no count", "write a whole number")
        return int(self.words[k])


def words_of(text: str) -> list[str]:
    """The words between blanks; a name in double quotes is one word, with its quotes."""
    return _WORD.findall(text) if '"' in text else blank_separated(text)


def blank_separated(text: str) -> list[str]:
    """The words between blanks of ASCII: a no-break space or a thin one parts no words, as in `10\u2009000`."""
    return text.split() if text.isascii() else _BLANK_FREE.findall(text)


def word_lines(path: Path, reporter: Reporter = SILENT, *, blanks: str = "", remark: str = "") -> list[TextLine]:
    """The lines of a file that have words; signs of `blanks` part them too, what begins with `remark` is left out.

    Raises
    ------
    InputError
        If there are none.
    """
    as_blanks = str.maketrans(dict.fromkeys(blanks, " "))
    words = [(k, words_of(text.translate(as_blanks))) for k, text in enumerate(read_lines(path, reporter), 1)]
    rows = [TextLine(w, path, k) for k, w in words if w and not (remark and w[0].startswith(remark))]
    if not rows:
        raise InputError("the file has no rows", where=str(path), remedy="put the data in")
    return rows


def once(at: PlaceT, name: str, first: dict[str, PlaceT], what: str, remedy: str = "remove one") -> None:
    """Refuse a name that has stood before among those of its kind, whose places are kept in `first`."""
    if (before := first.setdefault(name, at)) is not at:
        place = f"line {before.line}" if before.path == at.path else f"{before.path.name}:{before.line}"
        raise error_at(at, f"{what} {clipped(name)} twice, first in {place}", remedy)


def check_positive(at: ReadAt, sigma: Sequence[float]) -> None:
    """Refuse standard deviations that are zero or negative; NaN is one that is not stated."""
    if any(value <= 0 for value in sigma):
        stated = ", ".join(f"{value:g}" for value in sigma)
        raise error_at(at, f"standard deviations {stated}", "they are positive, in m")


def places(rows: Sequence[ReadAt], files: Sequence[Path]) -> dict[str, list[int]]:
    """The columns `file` and `line` of rows read in some files."""
    number = {path: k for k, path in enumerate(files)}
    return {"file": [number[row.path] for row in rows], "line": [row.line for row in rows]}
