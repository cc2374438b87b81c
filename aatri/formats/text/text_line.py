"""A line of a text file of words or cells: its words, and where it stands."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from aatri.errors import InputError
from aatri.formats.text.number_text import number_of
from aatri.ids import clipped


@dataclass(frozen=True)
class TextLine:
    """The words of a line, and where it stands."""

    words: list[str]
    path: Path
    line: int

    def error(self, what: str, remedy: str = "") -> InputError:
        """An error at this line."""
        return InputError(what, where=f"{self.path}:{self.line}", remedy=remedy)

    def number(self, k: int) -> float:
        """The word as a number."""
        try:
            return number_of(self.words[k])
        except ValueError as error:
            raise self.error(f"{clipped(self.words[k])!r}: {error}", "write it like -1234.5") from error

    def count(self, k: int) -> int:
        """The word as a whole number, not negative."""
        if not (self.words[k].isascii() and self.words[k].isdigit() and len(self.words[k]) < 9):
            raise self.error(f"{clipped(self.words[k])!r} is no count", "write a whole number")
        return int(self.words[k])
