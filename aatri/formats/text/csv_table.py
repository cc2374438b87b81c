"""Strict CSV: typed columns, and the place of every cell.

UTF-8, comma, a header row with the columns in any order. `#` starts a comment line, blank lines are skipped. Columns
named `x_...` are the user's own and are ignored; any other unknown column is an error. An empty cell is *not given*.
Numbers are those of `number_text`. An apostrophe before a text that begins with = + - @ does not count: it keeps
spreadsheets from computing the cell. Columns are read in chunks of lines, so that a million rows take seconds; faults
are collected.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from aatri.arrays import Float, Int
from aatri.errors import Faults, InputError, raise_all
from aatri.formats.text.csv_cells import Malformed, cells_of, columns_of_lines, start_of_cell, unshielded
from aatri.formats.text.number_text import numbers_of, what_is_wrong
from aatri.formats.text.text_file import read_lines
from aatri.ids import OF_IDS, clipped, did_you_mean, invalid, several
from aatri.progress import SILENT, Reporter

MOST_PER_COLUMN = 20
"""So many faults of one column are shown with their place; the rest is counted."""

_CHUNK = 50_000


class CsvColumn(NamedTuple):
    """What a column may hold: an `id`, `text` or a `number`; `must` be there: the `column`, or every `cell`."""

    kind: Literal["id", "text", "number"]
    must: Literal["", "column", "cell"] = ""


@dataclass(frozen=True, eq=False)
class CsvTable:
    """The rows of a CSV file. A column that is not in the file has empty texts or NaN."""

    path: Path
    header: tuple[str, ...]
    line: Int
    text: dict[str, list[str]]
    number: dict[str, Float]
    source: Sequence[str] = field(repr=False)
    problems: Faults = field(default_factory=Faults)

    def __len__(self) -> int:
        return len(self.line)

    def taken(self, rows: Sequence[int]) -> CsvTable:
        """The table of some of its rows."""
        text = {name: [cells[k] for k in rows] for name, cells in self.text.items()}
        number = {name: values[rows] for name, values in self.number.items()}
        return replace(self, line=self.line[rows], text=text, number=number)

    def where(self, row: int, column: str = "") -> str:
        """`file:line:character` of a cell; of the row if the file does not have the column."""
        line = int(self.line[row])
        if column not in self.header:
            return f"{self.path}:{line}:1"
        return f"{self.path}:{line}:{start_of_cell(self.source[line - 1], self.header.index(column))}"

    def complain(self, rows: npt.ArrayLike | Sequence[int], column: str, what: str, remedy: str = "") -> None:
        """Add an error for each of the rows; `{}` in `what` stands for the cell."""
        places = np.asarray(rows, dtype=np.intp)
        for row in places[:MOST_PER_COLUMN]:
            cell = repr(clipped(self.cell(int(row), column)))
            self.problems.add(what.replace("{}", cell), self.where(int(row), column), remedy)
        if len(places) > MOST_PER_COLUMN:
            more = f"column {column}: {several(len(places) - MOST_PER_COLUMN, 'more cell')} of this kind"
            self.problems.add(more, str(self.path))

    def complain_of_numbers(
        self, rows: Sequence[int], column: str, remedy: str = "write it like -1234.5 or 1e-3, or leave the cell empty"
    ) -> None:
        """Add an error for each cell that is no number, or none of its unit, with the reason."""
        reasons: dict[str, list[int]] = {}
        for row in rows:
            reasons.setdefault(what_is_wrong(self.cell(row, column)) or "not of this unit", []).append(row)
        for reason, of_reason in reasons.items():
            self.complain(of_reason, column, f"{column} is {{}}: {reason}", remedy)

    def cell(self, row: int, column: str) -> str:
        """The cell as written, without outer blanks."""
        if column not in self.header:
            return ""
        return cells_of(self.source[int(self.line[row]) - 1])[self.header.index(column)]


def read_csv(path: Path, columns: Mapping[str, CsvColumn], problems: Faults, reporter: Reporter = SILENT) -> CsvTable:
    """Read a CSV file.

    Parameters
    ----------
    columns : mapping of str to CsvColumn
        The columns of the contract.
    problems : list of AatriError
        Faults are added here; the returned table is only fit for use if none were.

    Raises
    ------
    InputError
        If the file cannot be read at all, or its header is wrong.
    """
    source = read_lines(path, reporter)
    lines = [k for k, text in enumerate(source, 1) if (body := text.lstrip()) and body[0] != "#" and not _blank(body)]
    if not lines:
        raise InputError("the file has no header row, only comments", where=str(path), remedy="write the column names")
    header = _header(path, source, lines.pop(0), columns)
    named = _named(header)
    texts: dict[str, list[str]] = {name: [] for name in columns if columns[name].kind != "number"}
    numbers: dict[str, list[Float]] = {name: [] for name in columns if columns[name].kind == "number"}
    bad_numbers: dict[str, list[int]] = {name: [] for name in numbers}
    good: list[int] = []
    malformed: list[Malformed] = []
    pool: dict[str, str] = {}
    for first in range(0, len(lines), _CHUNK):
        cells, rows, faults = columns_of_lines(source, lines[first : first + _CHUNK], len(header))
        by_name = dict(zip(header, cells))
        for nameless in cells[named:]:
            faults += _without_name(source, rows, nameless, named)
        for name in texts:
            column = by_name.get(name)
            if column and "'" in "".join(column):
                column = list(map(unshielded, column))
            texts[name] += map(pool.setdefault, column, column) if column else [""] * len(rows)
        for name in numbers:
            values, bad = numbers_of(by_name.get(name) or [""] * len(rows))
            numbers[name].append(values)
            bad_numbers[name] += [len(good) + k for k in bad]
        good += rows
        malformed += faults
    _explain_lines(path, malformed, problems)
    joined = {name: np.concatenate(parts) if parts else np.zeros(0) for name, parts in numbers.items()}
    table = CsvTable(path, header[:named], np.array(good, dtype=np.int32), texts, joined, source, problems)
    for name, bad in bad_numbers.items():
        table.complain_of_numbers(bad, name)
    _check_cells(table, columns, bad_numbers)
    return table


def _blank(body: str) -> bool:
    """Whether a line has no cell with anything in it, as spreadsheets write below their tables."""
    return body[0] == "," and not body.strip(", \t\r\n")


def _named(header: tuple[str, ...]) -> int:
    """Columns up to the last that has a name: spreadsheets write empty ones to the right of their tables."""
    return max((k for k, name in enumerate(header, 1) if name), default=0)


def _without_name(source: Sequence[str], rows: Sequence[int], column: Sequence[str], named: int) -> list[Malformed]:
    """Lines with something in a column that has no name."""
    if not any(column):
        return []
    what = f"{{}} stands beyond the {named} columns that have a name"
    return [
        Malformed(line, start_of_cell(source[line - 1], named), what.format(repr(clipped(cell))), "name the column")
        for line, cell in zip(rows, column)
        if cell
    ]


def _header(path: Path, source: Sequence[str], line: int, columns: Mapping[str, CsvColumn]) -> tuple[str, ...]:
    text = source[line - 1]
    try:
        header = tuple(cells_of(text))
    except csv.Error as error:
        raise InputError(f"broken header: {error}", where=f"{path}:{line}:1", remedy="check the quotes") from error
    faults = Faults()
    if len(header) == 1 and (";" in text or "\t" in text):
        sign = "semicolons" if ";" in text else "tabs"
        raise InputError(f"separated by {sign}", where=f"{path}:{line}:1", remedy="export with commas")
    for k, name in enumerate(header[: _named(header)]):
        where = f"{path}:{line}:{start_of_cell(text, k)}"
        if name in header[:k]:
            faults.add(f"column {clipped(name)!r} twice", where, "remove one")
        elif name not in columns and not name.startswith("x_"):
            what = f"unknown column {clipped(name)!r}{did_you_mean(name, columns)}"
            remedy = f"columns are {', '.join(columns)}; your own start with x_"
            faults.add(what, where, remedy)
    absent = [name for name, declared in columns.items() if declared.must and name not in header]
    if absent:
        what = f"column {', '.join(absent)} missing"
        faults.add(what, f"{path}:{line}:1", "add it to the header and to every row")
    raise_all(faults)
    return header


def _explain_lines(path: Path, malformed: Sequence[Malformed], problems: Faults) -> None:
    for fault in malformed[:MOST_PER_COLUMN]:
        where = f"{path}:{fault.line}:{fault.character}"
        problems.add(fault.what, where, fault.remedy)
    if len(malformed) > MOST_PER_COLUMN:
        more = f"{several(len(malformed) - MOST_PER_COLUMN, 'more line')} of this kind"
        problems.add(more, str(path), "check the separator and the export")


def _check_cells(table: CsvTable, columns: Mapping[str, CsvColumn], bad_number: Mapping[str, list[int]]) -> None:
    """Required cells are there; ids are ids."""
    for name, declared in columns.items():
        if declared.must == "cell":
            if declared.kind == "number":
                empty = set(np.flatnonzero(np.isnan(table.number[name])).tolist()) - set(bad_number.get(name, []))
                rows = sorted(empty)
            else:
                rows = [k for k, text in enumerate(table.text[name]) if not text] if "" in table.text[name] else []
            table.complain(rows, name, f"{name} is empty", "every row needs it")
        if declared.kind != "number" and (wrong := set(invalid(set(table.text[name]) - {""}))):
            rows = [k for k, text in enumerate(table.text[name]) if text in wrong]
            table.complain(rows, name, f"{name} {{}} is no id or name", OF_IDS)
