"""Numbers taken wrongly: a cell of a good input is written anew, in a way whose meaning is known.

The grammar of numbers is written here a second time (`meaning`): digits of ASCII with a point and an exponent. A text
that means a number must be read as that number, one that means the old number must be read at all, and a text that
means none must be refused with file and line. Which words of an input are numbers is found out by changing them: those
whose change moves figures of what is read and nothing else.
"""

from __future__ import annotations

import random
import re
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from aatri.artifacts.block import Block
from aatri.errors import AatriError
from aatri.tables.schema import columns_of, tables_of
from tests.campaigns.fuzz_seeds import READERS, Reader

_WORD = re.compile(rb"""(?<![^\s,:"\[\]{}=])[+-]?[0-9][0-9.eE+-]*(?![^\s,"\[\]{}])""")
STEP = 1e-4
"""Change of a number that tells what it does, of its size."""
NEAR = 1e-6
"""Agreement of a figure with its prediction, of the change."""
OF_YAML = ("block",)
IN_ANY_LINE = ("bal",)
"""Readers of a stream of numbers: a number too many is told of the file."""


@dataclass(frozen=True)
class Cell:
    """A number of a file: its place, its value, its line, and what it does to what is read."""

    first: int
    last: int
    value: float
    line: int
    slope: dict[str, Any] | None
    """By how much the figures move; None if not in proportion."""


@dataclass
class Numbers:
    """The numbers of the files of a reader; each is looked at when it is first needed."""

    name: str
    folder: Path
    good: dict[str, bytes]
    cells: dict[tuple[str, int], Cell | None] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.reader: Reader = READERS[self.name]
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
        expected = meaning(text, yaml=self.name in OF_YAML)
        try:
            after = figures(self._written(file, cell.first, cell.last, text))
        except AatriError as error:
            if expected == cell.value:
                return f"{file}:{cell.line}: {text!r} is refused: {str(error)[:200]}"
            place = str(self.folder / file) + (f":{cell.line}" if self.name not in IN_ANY_LINE else "")
            named = place in str(error) or expected is not None
            return "" if named else f"{file}:{cell.line}: {text!r} is refused elsewhere: {str(error)[:200]}"
        if expected is None:
            return f"{file}:{cell.line}: {text!r} for {old!r} is read"
        plain = figures(self._written(file, cell.first, cell.last, repr(expected)))
        same = all(np.array_equal(after[k], plain[k], equal_nan=_is_figure(plain[k])) for k in plain)
        if same and (cell.slope is None or not self._differs(after, cell.slope, expected - cell.value)):
            return ""
        return f"{file}:{cell.line}: {text!r} is taken wrongly"

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
        if any(
            near[k].shape != old.shape or (not _is_figure(old) and (near[k] != old).any())
            for k, old in self.before.items()
        ):
            return None
        moved = {k: near[k] - old for k, old in self.before.items() if _is_figure(old)}
        slope = {k: change / step for k, change in moved.items() if np.nan_to_num(change).any()}
        if slope:
            line = 1 + self.good[file].count(b"\n", 0, first)
            known = None if self._differs(far, slope, 2 * step, NEAR / 100) else slope
            self.cells[file, first] = Cell(first, last, value, line, known)
        return self.cells[file, first]

    def _differs(self, after: dict[str, Any], slope: dict[str, Any], change: float, near: float = NEAR) -> bool:
        """Whether what is read is not what a change of the number makes of what was read; rows may change places."""
        for name, before in self.before.items():
            read = after[name]
            if before.shape != read.shape:
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


def _near(read: Any, expected: Any, tolerance: Any) -> bool:
    return bool(((np.abs(read - expected) <= tolerance) | (np.isnan(read) & np.isnan(expected))).all())


def figures(read: Any) -> dict[str, Any]:
    """The columns of a Block, without where its rows were read."""
    assert isinstance(read, Block)
    found = {}
    for table in tables_of(Block):
        rows = getattr(read, table)
        for column in columns_of(type(rows)) if rows is not None else ():
            if column not in ("file", "line"):
                found[f"{table}.{column}"] = getattr(rows, column)
    return found


def _is_figure(column: Any) -> bool:
    return bool(column.dtype.kind == "f")


def meaning(text: str, *, yaml: bool = False) -> float | None:
    """The number a text means, None if none: `[+-] digits [. digits] [e [+-] digits]`, digits 0 to 9.

    YAML has no numbers with a leading zero.
    """
    sign, body = (text[:1], text[1:]) if text[:1] in ("+", "-") else ("", text)
    mantissa, e, power = body.replace("E", "e").partition("e")
    whole, _, part = mantissa.partition(".")
    exponent = power[1:] if power[:1] in ("+", "-") else power
    digits = set("0123456789")
    if not whole + part or set(whole + part) - digits or (e and (not exponent or set(exponent) - digits)):
        return None
    if len(text) > 300 or (yaml and len(whole) > 1 and whole[0] == "0") or len(exponent.lstrip("0")) > 3:
        return None
    number = Fraction(int(whole or "0")) + Fraction(int(part or "0"), 10 ** len(part))
    number *= Fraction(10) ** (int(power) if e else 0)
    if number > 10**100:
        return None
    return float(-number if sign == "-" else number)


def _signed(old: str) -> str:
    return old if old[0] in "+-" else f"+{old}"


def _longer(old: str) -> str:
    return old + ("000" if "." in old and "e" not in old.lower() else "")


def _scientific(old: str) -> str:
    number = Fraction(old)
    return f"{float(number / 10)!r}E+01" if float(number / 10) * 10 == float(number) else old


def _shifted(old: str) -> str:
    return old if "e" in old.lower() else f"{old}e0"


def _another(old: str) -> str:
    return repr(float(old) * (1 + 3 * STEP))


def _one_digit_more(old: str) -> str:
    return old if "e" in old.lower() else old + ("7" if "." in old else ".00007")


def _with(sign: str, at: int = -1):  # type: ignore[no-untyped-def]
    return lambda old: old[:at] + sign + old[at:] if len(old) > 1 else f"{old}{sign}{old}"


def _digits(zero: str):  # type: ignore[no-untyped-def]
    return lambda old: "".join(chr(ord(zero) + int(c)) if c in "0123456789" else c for c in old)


RIGHT = (_signed, _longer, _scientific, _shifted)
"""The same number in other words."""
NEW = (_another, _one_digit_more)
"""Another number."""
WRONG = (
    _with("_"),
    _with(","),
    _with("'"),
    _with("\u00a0"),
    _with("\u2009"),
    _with(" "),
    _with(".."),
    _with("x"),
    _digits("\u0660"),
    _digits("\uff10"),
    _digits("\u09e6"),
    lambda old: old.replace(".", ",") if "." in old else f"{old},5",
    lambda old: f"{old}-",
    lambda old: f"--{old}",
    lambda old: f"+-{old}",
    lambda old: f"\u2212{old.lstrip('+-')}",
    lambda old: f"{old}e",
    lambda old: f"{old}e999",
    lambda old: f"{old}d1",
    lambda old: f"{old}m",
    lambda old: f"{old}%",
    lambda old: f"({old})",
    lambda old: f"{old}/2",
    lambda old: f"{old}f",
    lambda old: f"{old}j",
    lambda old: f"{old}\u00b2",
    lambda old: f"{old}\u00b0",
    lambda _: "nan",
    lambda _: "inf",
    lambda _: "-Infinity",
    lambda _: "0x1F",
    lambda _: "1#QNAN",
    lambda _: "***",
    lambda _: ".",
    lambda _: "-",
    lambda _: "1e5.5",
    lambda _: "True",
    lambda _: "None",
    lambda _: "1:30",
)
"""Texts that mean no number."""
