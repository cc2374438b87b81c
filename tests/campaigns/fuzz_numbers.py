"""Numbers taken wrongly: a cell of a good input is written anew, in a way whose meaning is known.

The grammar of numbers is written a second time in `number_texts.meaning`: digits of ASCII with a point and an
exponent. A text that means a number must be read as that number, one that means the old number must be read at all,
and a text that means none must be refused with file and line, `nan` also where it leaves the figure open. Which words
of an input are numbers is found out by changing them: those whose change moves figures of what is read and nothing
else.
"""

from __future__ import annotations

import random
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from aatri.artifacts.block import Block
from aatri.errors import AatriError
from aatri.tables.schema import Table, columns_of, tables_of
from tests.campaigns.fuzz_seeds import Reader
from tests.campaigns.number_texts import NEW, RIGHT, STEP, WRONG, meaning

_WORD = re.compile(rb"""(?<![^\s,:"\[\]{}=>])[+-]?[0-9][0-9.eE+-]*(?![^\s,"\[\]{}<])""")
NEAR = 1e-6
"""Agreement of a figure with its prediction, of the change."""
IN_ANY_LINE = ("p.txt",)
"""Files of a stream of numbers: a number too many is told of the file."""
IN_COLUMNS = ("block.ori", "geoin.dat")
"""Files of columns of fixed width, which a longer number does not fit."""
WITH_DASHES = ("control.txt", "check.txt")
"""Files in which a dash stands for a coordinate that is not known."""


@dataclass(frozen=True)
class Cell:
    """A number of a file: its place, its value, its line, and what it does to what is read."""

    first: int
    last: int
    value: float
    line: int
    opened: int
    """The line in which the list or element begins that it is in: that of its own where it is in none."""
    slope: dict[str, Any] | None
    """By how much the figures move; None if not in proportion."""


@dataclass
class Numbers:
    """The numbers of the files of a reader; each is looked at when it is first needed."""

    reader: Reader
    folder: Path
    good: dict[str, bytes]
    cells: dict[tuple[str, int], Cell | None] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.before = figures(self.read())
        self.words = [
            (file, found.span())
            for file in self.reader.files
            for found in _WORD.finditer(self.good[file])
            if meaning(found.group().decode()) is not None
        ]

    def read(self) -> Any:
        return self.reader.read(self.folder)

    def wrong(self, chance: random.Random) -> str:
        """What is wrong with the reading of one cell written anew; empty if nothing is."""
        file, span = chance.choice(self.words)
        cell = self.cells[file, span[0]] if (file, span[0]) in self.cells else self._looked_at(file, span)
        if cell is None:
            return ""
        old = self.good[file][cell.first : cell.last].decode()
        text = chance.choice(chance.choice((RIGHT, NEW, WRONG, WRONG)))(old)
        expected = meaning(text, self._grammar(file, cell.first))
        try:
            after = figures(self._written(file, cell.first, cell.last, text))
        except AatriError as error:
            if expected == cell.value and (file not in IN_COLUMNS or len(text) == len(old)):
                return f"{file}:{cell.line}: {text!r} is refused: {str(error)[:200]}"
            lines = ("",) if file in IN_ANY_LINE else {f":{line}" for line in (cell.line, cell.opened)}
            named = any(f"{self.folder / file}{line}" in str(error) for line in lines) or expected is not None
            return "" if named else f"{file}:{cell.line}: {text!r} is refused elsewhere: {str(error)[:200]}"
        may_be_open = text == "nan" or (text == "-" and file in WITH_DASHES)
        if expected is None and not (may_be_open and self._left_open(after)):
            return f"{file}:{cell.line}: {text!r} for {old!r} is read"
        if expected is None:
            return ""
        plain = figures(self._written(file, cell.first, cell.last, repr(expected)))
        same = after.keys() == plain.keys() and all(
            np.array_equal(after[k], plain[k], equal_nan=_is_figure(plain[k])) for k in plain
        )
        if same and (cell.slope is None or not self._differs(after, cell.slope, expected - cell.value)):
            return ""
        if same and self._is_between(file, cell, expected, after):
            return ""
        return f"{file}:{cell.line}: {text!r} is taken wrongly"

    def _left_open(self, after: dict[str, Any]) -> bool:
        """Whether all figures that are others than before are not known: no other number was taken for them."""
        return all(
            k in after and after[k].shape == old.shape and np.isnan(after[k][_differing(after[k], old)]).all()
            for k, old in self.before.items()
            if _is_figure(old)
        )

    def _is_between(self, file: str, cell: Cell, value: float, after: dict[str, Any]) -> bool:
        """Whether what is read lies in the middle of what numbers a little less and more give: of bent functions."""
        step = NEAR * (abs(value) or 1.0)
        low, high = (figures(self._written(file, cell.first, cell.last, repr(value + k * step))) for k in (-1, 1))
        return all(
            _near(after[k], (low[k] + high[k]) / 2, 1e-3 * np.abs(high[k] - low[k]) + 1e-9 * np.abs(after[k]) + 1e-15)
            for k in after
            if _is_figure(after[k])
        )

    def _grammar(self, file: str, first: int) -> str:
        """Whose numbers stand there: what is quoted is a text to YAML and JSON."""
        quoted = self.good[file][first - 1 : first] == b'"'
        return "" if quoted or Path(file).suffix not in (".yaml", ".json") else Path(file).suffix

    def _written(self, file: str, first: int, last: int, text: str) -> Any:
        """What is read with a text in place of another."""
        good = self.good[file]
        (self.folder / file).write_bytes(good[:first] + text.encode() + good[last:])
        try:
            return self.read()
        finally:
            (self.folder / file).write_bytes(good)

    def _looked_at(self, file: str, span: tuple[int, int]) -> Cell | None:
        """The cell of a word; None if it is no number, or one without effect."""
        first, last = span
        value = meaning(self.good[file][first:last].decode()) or 0.0
        step = STEP * (abs(value) or 1.0)
        self.cells[file, first] = None
        try:
            near, far = (figures(self._written(file, first, last, repr(value + k * step))) for k in (1, 2))
        except AatriError:
            return None
        if near.keys() != self.before.keys() or any(
            near[k].shape != old.shape or (not _is_figure(old) and (near[k] != old).any())
            for k, old in self.before.items()
        ):
            return None
        moved = {k: near[k] - old for k, old in self.before.items() if _is_figure(old)}
        slope = {k: change / step for k, change in moved.items() if np.nan_to_num(change).any()}
        if slope:
            opening = max(self.good[file].rfind(sign, 0, first) for sign in (b"<", b"[", b"{"))
            line, opened = (1 + self.good[file].count(b"\n", 0, at) for at in (first, max(opening, 0)))
            known = None if self._differs(far, slope, 2 * step, NEAR / 100) else slope
            self.cells[file, first] = Cell(first, last, value, line, opened if opening >= 0 else line, known)
        return self.cells[file, first]

    def _differs(self, after: dict[str, Any], slope: dict[str, Any], change: float, near: float = NEAR) -> bool:
        """Whether what is read is not what a change of the number makes of what was read; rows may change places."""
        for name, before in self.before.items():
            read = after.get(name)
            if read is None or before.shape != read.shape:
                return True
            if not _is_figure(before):
                if not np.array_equal(before, read) and not np.array_equal(np.sort(before), np.sort(read)):
                    return True
                continue
            moved = change * slope.get(name, 0.0)
            tolerance = near * np.abs(moved) + 1e-12 * np.abs(before) + 1e-15
            if not _near(read, before + moved, tolerance) and not _near(
                np.sort(read, axis=None), np.sort(before + moved, axis=None), float(np.nanmax(tolerance))
            ):
                return True
        return False


def _differing(read: Any, before: Any) -> Any:
    return (read != before) & ~(np.isnan(read) & np.isnan(before))


def _near(read: Any, expected: Any, tolerance: Any) -> bool:
    return bool(((np.abs(read - expected) <= tolerance) | (np.isnan(read) & np.isnan(expected))).all())


def figures(read: Any) -> dict[str, Any]:
    """The columns of a Block or of what a source gives of one, without where its rows were read."""
    columns = {}
    for name in tables_of(Block):
        table = getattr(read, name, None)
        rows = table if isinstance(table, Mapping) else of_table(table) if isinstance(table, Table) else {}
        columns |= {f"{name}.{column}": np.asarray(v) for column, v in rows.items() if column not in ("file", "line")}
    return columns


def of_table(table: Table) -> dict[str, Any]:
    """The columns of a table by name."""
    return {name: getattr(table, name) for name in columns_of(type(table))}


def _is_figure(column: Any) -> bool:
    return bool(column.dtype.kind == "f")
