"""Strict CSV: typed columns, and the place of every cell.

UTF-8, comma, a header row with the columns in any order. `#` starts a comment line, blank lines are skipped, blanks
around a cell do not count, quotes as in RFC 4180 but within one line. Columns named `x_...` are the user's own and are
ignored; any other unknown column is an error. A number is ASCII digits with a point and an exponent, and nothing else:
no decimal comma, thousands separator, nan, inf or full-width digit. An empty cell is *not given*.

Columns are checked whole, in chunks of lines; only when that fails are the cells looked at one by one, to find the
place. Errors are collected.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from aatri.errors import InputError, raise_all
from aatri.formats.text_file import read_lines
from aatri.ids import did_you_mean, is_valid, printable
from aatri.progress import SILENT, Reporter

Float = npt.NDArray[np.float64]

MOST_PER_COLUMN = 20
"""So many faults of one column are shown with their place; the rest is counted."""

_CHUNK = 50_000
_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
_FOREIGN = re.compile(r"[^0-9+\-.eE\n]")


class Column(NamedTuple):
    """What a column may hold: an `id`, `text` or a `number`; `must` be there: the `column`, or every `cell`."""

    kind: Literal["id", "text", "number"]
    must: Literal["", "column", "cell"] = ""


@dataclass(frozen=True, eq=False)
class CsvTable:
    """The rows of a CSV file. A column that is not in the file has empty texts or NaN."""

    path: Path
    header: tuple[str, ...]
    line: npt.NDArray[np.int32]
    text: dict[str, list[str]]
    number: dict[str, Float]
    source: Sequence[str] = field(repr=False)
    problems: list[InputError] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.line)

    def where(self, row: int, column: str = "") -> str:
        """`file:line:character` of a cell; of the row if the file does not have the column."""
        line = int(self.line[row])
        if column not in self.header:
            return f"{self.path}:{line}:1"
        return f"{self.path}:{line}:{_start_of_cell(self.source[line - 1], self.header.index(column))}"

    def complain(self, rows: npt.ArrayLike | Sequence[int], column: str, what: str, remedy: str = "") -> None:
        """Add an error for each of the rows; `{}` in `what` stands for the cell."""
        found = np.asarray(rows, dtype=np.intp)
        for row in found[:MOST_PER_COLUMN]:
            cell = repr(printable(self.cell(int(row), column)))
            self.problems.append(
                InputError(what.replace("{}", cell), where=self.where(int(row), column), remedy=remedy)
            )
        if len(found) > MOST_PER_COLUMN:
            more = f"column {column}: {len(found) - MOST_PER_COLUMN} more cells of this kind"
            self.problems.append(InputError(more, where=str(self.path)))

    def cell(self, row: int, column: str) -> str:
        """The cell as written, without outer blanks."""
        if column not in self.header:
            return ""
        return _cells(self.source[int(self.line[row]) - 1])[self.header.index(column)]


def read_csv(path: Path, columns: Mapping[str, Column], problems: list[InputError],
             reporter: Reporter = SILENT) -> CsvTable:  # fmt: skip
    """Read a CSV file.

    Parameters
    ----------
    path : Path
    columns : mapping of str to Column
        The columns of the contract.
    problems : list of InputError
        Faults are added here; the returned table is only fit for use if none were.

    Raises
    ------
    InputError
        If the file cannot be read at all, or its header is wrong.
    """
    source = read_lines(path, reporter)
    lines = [k for k, text in enumerate(source, 1) if (body := text.lstrip()) and body[0] != "#"]
    if not lines:
        raise InputError("the file has no header row, only comments", where=str(path), remedy="write the column names")
    header = _header(path, source, lines.pop(0), columns)
    good, texts, numbers = [], {}, {}
    kept = [(k, name) for k, name in enumerate(header) if name in columns]
    parts: dict[str, list[Float]] = {name: [] for _, name in kept if columns[name].kind == "number"}
    texts = {name: [""] * 0 for _, name in kept if columns[name].kind != "number"}
    pool: dict[str, str] = {}
    bad_number: dict[str, list[int]] = {name: [] for name in parts}
    for first in range(0, len(lines), _CHUNK):
        rows, numbered = _rows(path, source, lines[first : first + _CHUNK], len(header), problems)
        good.append(np.array(numbered, dtype=np.int32))
        for (k, name), cells in zip(kept, [[row[k] for row in rows] for k, _ in kept]):
            if name in texts:
                texts[name] += [pool.setdefault(cell, cell) for cell in cells]
            else:
                values, bad = _numbers(cells)
                offset = sum(map(len, parts[name]))
                bad_number[name] += [offset + k for k in bad]
                parts[name].append(values)
    line = np.concatenate(good) if good else np.zeros(0, np.int32)
    for name, declared in columns.items():
        if parts.get(name):
            numbers[name] = np.concatenate(parts[name])
        elif declared.kind == "number":
            numbers[name] = np.full(len(line), np.nan)
        elif name not in texts:
            texts[name] = [""] * len(line)
    table = CsvTable(path, header, line, texts, numbers, source, problems)
    for name, bad in bad_number.items():
        _explain_numbers(table, name, bad)
    _check_cells(table, columns, bad_number)
    return table


def number_of(text: str) -> float:
    """The number a cell holds.

    Raises
    ------
    ValueError
        If it is none by the rules above.
    """
    if not _NUMBER.fullmatch(text):
        raise ValueError(_what_is_wrong(text))
    value = float(text)
    if not np.isfinite(value):
        raise ValueError("too large for a number")
    return value


def _header(path: Path, source: Sequence[str], line: int, columns: Mapping[str, Column]) -> tuple[str, ...]:
    text = source[line - 1]
    try:
        header = tuple(_cells(text))
    except csv.Error as error:
        raise InputError(f"broken header: {error}", where=f"{path}:{line}:1", remedy="check the quotes") from error
    faults = []
    if len(header) == 1 and (";" in text or "\t" in text):
        sign = "semicolons" if ";" in text else "tabs"
        raise InputError(f"separated by {sign}", where=f"{path}:{line}:1", remedy="export with commas")
    for k, name in enumerate(header):
        where = f"{path}:{line}:{_start_of_cell(text, k)}"
        if name in header[:k]:
            faults.append(InputError(f"column {printable(name)!r} twice", where=where, remedy="remove one"))
        elif name not in columns and not name.startswith("x_"):
            what = f"unknown column {printable(name)!r}{did_you_mean(name, columns)}"
            remedy = f"columns are {', '.join(columns)}; your own start with x_"
            faults.append(InputError(what, where=where, remedy=remedy))
    absent = [name for name, declared in columns.items() if declared.must and name not in header]
    if absent:
        what = f"column {', '.join(absent)} missing"
        faults.append(InputError(what, where=f"{path}:{line}:1", remedy="add it to the header and to every row"))
    raise_all(faults)
    return header


def _rows(path: Path, source: Sequence[str], lines: Sequence[int], width: int,
          problems: list[InputError]) -> tuple[list[list[str]], list[int]]:  # fmt: skip
    """The well-formed rows of these lines, and their line numbers."""
    rows: list[list[str]] = []
    numbered = []
    for line in lines:
        text = source[line - 1]
        try:
            cells = text.split(",") if '"' not in text else _cells(text)
        except csv.Error as error:
            what = "a quote that is not closed in its line" if "unexpected end" in str(error) else f"broken: {error}"
            where = f"{path}:{line}:{text.index(chr(34)) + 1}"
            problems.append(InputError(what, where=where, remedy='close it; a quote inside a cell is written ""'))
            continue
        if len(cells) != width:
            what = f"{len(cells)} cells, but the header has {width} columns"
            remedy = "write an empty cell for what is not given; decimal point, not comma"
            problems.append(InputError(what, where=f"{path}:{line}:1", remedy=remedy))
            continue
        rows.append(cells)
        numbered.append(line)
    if any(" " in source[line - 1] or "\t" in source[line - 1] for line in numbered):
        rows = [[cell.strip(" \t") for cell in cells] for cells in rows]
    return rows, numbered


def _cells(text: str) -> list[str]:
    if '"' not in text:
        return [cell.strip(" \t") for cell in text.split(",")]
    return [cell.strip(" \t") for cell in next(csv.reader([text], strict=True, skipinitialspace=True))]


def _start_of_cell(text: str, index: int) -> int:
    """Character, from 1, at which a cell of a line begins."""
    quoted, commas = False, []
    for position, sign in enumerate(text):
        if sign == '"':
            quoted = not quoted
        elif sign == "," and not quoted:
            commas.append(position)
    start = ([-1, *commas])[index] + 1
    return start + len(text[start:]) - len(text[start:].lstrip(" \t")) + 1


def _numbers(cells: list[str]) -> tuple[Float, list[int]]:
    """Values, NaN where empty, and which cells are no numbers."""
    if not _FOREIGN.search("\n".join(cells)):
        try:
            values = np.array([float(cell) if cell else np.nan for cell in cells], dtype=np.float64)
            if not np.isinf(values).any():
                return values, []
        except ValueError:
            pass
    values = np.full(len(cells), np.nan)
    bad = []
    for k, cell in enumerate(cells):
        if cell:
            try:
                values[k] = number_of(cell)
            except ValueError:
                bad.append(k)
    return values, bad


def _explain_numbers(table: CsvTable, name: str, bad: list[int]) -> None:
    reasons: dict[str, list[int]] = {}
    for row in bad:
        reasons.setdefault(_what_is_wrong(table.cell(row, name)), []).append(row)
    for reason, rows in reasons.items():
        table.complain(
            rows, name, f"{name} is {{}}: {reason}", "write it like -1234.5 or 1e-3, or leave the cell empty"
        )


def _what_is_wrong(cell: str) -> str:
    if _NUMBER.fullmatch(cell):
        return "too large for a number"
    if re.fullmatch(r"[+-]?(nan|inf|infinity)", cell, re.IGNORECASE) or cell.startswith(("#", "1.#")):
        return "not a finite number"
    if any(sign in cell for sign in "\u2212\u2013\uff0d"):
        return "a minus sign that is not the ASCII one"
    if any(sign.isdigit() and not sign.isascii() for sign in cell):
        return "a digit that is not ASCII (full-width?)"
    if re.fullmatch(r"[+-]?[0-9]+,[0-9]+", cell):
        return "a decimal comma"
    if re.fullmatch(r"[+-]?[0-9]{1,3}([ _,'][0-9]{3})+(\.[0-9]*)?", cell):
        return "a thousands separator"
    return "not a number"


def _check_cells(table: CsvTable, columns: Mapping[str, Column], bad_number: Mapping[str, list[int]]) -> None:
    """Required cells are there; ids are ids."""
    for name, declared in columns.items():
        if declared.must == "cell":
            if declared.kind == "number":
                empty = set(np.flatnonzero(np.isnan(table.number[name])).tolist()) - set(bad_number.get(name, []))
                rows = sorted(empty)
            else:
                rows = [k for k, text in enumerate(table.text[name]) if not text]
            table.complain(rows, name, f"{name} is empty", "every row needs it")
        if declared.kind != "number":
            valid = {text: is_valid(text) for text in set(table.text[name]) if text}
            if not all(valid.values()):
                rows = [k for k, text in enumerate(table.text[name]) if text and not valid[text]]
                remedy = "at most 255 bytes, no control characters, no outer blanks"
                table.complain(rows, name, f"{name} {{}} is no id or name", remedy)
