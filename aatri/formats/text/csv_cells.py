"""Lines of CSV to cells: comma, quotes as in RFC 4180 but within one line, blanks around a cell do not count."""

import csv
import re
from collections.abc import Sequence
from itertools import repeat
from typing import NamedTuple

from aatri.ids import several

FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""What a cell begins with that spreadsheets compute or run."""


class Malformed(NamedTuple):
    """A line that is no row."""

    line: int
    character: int
    what: str
    remedy: str


def cells_of(text: str) -> list[str]:
    """The cells of a line.

    Raises
    ------
    csv.Error
        If a quote is not closed, or something follows it.
    """
    if '"' not in text:
        return [cell.strip(" \t") for cell in text.split(",")]
    return [cell.strip(" \t") for cell in next(csv.reader([text], strict=True, skipinitialspace=True))]


def shielded(text: str) -> str:
    """A text as a cell that no spreadsheet takes for a formula: `=1+1` becomes `'=1+1`.

    `unshielded` gives it back; a text that begins with such a sign after apostrophes gets one more.
    """
    return f"'{text}" if text.lstrip("'").startswith(FORMULA) else text


def unshielded(cell: str) -> str:
    """The text of a cell as spreadsheets show it: without the apostrophe before a formula."""
    return cell[1:] if cell.startswith("'") and cell.lstrip("'").startswith(FORMULA) else cell


_SEPARATES = re.compile('[",]')


def start_of_cell(text: str, index: int) -> int:
    """Character, from 1, at which a cell of a line begins."""
    start, cell, quoted, closed, plain = 0, 0, False, -2, False
    for separator in _SEPARATES.finditer(text):
        position = separator.start()
        if cell == index:
            break
        if separator.group() == ",":
            if not quoted:
                start, cell, plain = position + 1, cell + 1, False
        elif quoted:
            quoted, closed = False, position
        elif position == closed + 1:
            quoted = True  # two quotes are one within the cell
        elif not plain:  # a quote within a cell that does not begin with one is a sign like others
            quoted = not text[start:position].strip(" ")
            plain = not quoted
    rest = text[start:]
    return len(text) - len(rest.lstrip(" \t")) + 1


def columns_of_lines(
    source: Sequence[str], lines: Sequence[int], width: int
) -> tuple[list[list[str]], Sequence[int], list[Malformed]]:
    """The columns of a run of lines.

    Parameters
    ----------
    source : sequence of str
        All lines of the file.
    lines : sequence of int
        Numbers, from 1, of those that are rows.
    width : int
        Number of columns of the header.

    Returns
    -------
    columns : list of `width` lists of str
    lines : sequence of int
        The numbers of the well-formed ones.
    malformed : list of Malformed
    """
    texts = [source[line - 1] for line in lines]
    joined = "\n".join(texts)
    if '"' in joined or set(map(str.count, texts, repeat(","))) != {width - 1}:
        return _one_by_one(texts, lines, width)
    cells = ",".join(texts).split(",")
    if " " in joined or "\t" in joined:
        cells = [cell.strip(" \t") for cell in cells]
    return [cells[k::width] for k in range(width)], lines, []


def _one_by_one(
    texts: Sequence[str], lines: Sequence[int], width: int
) -> tuple[list[list[str]], Sequence[int], list[Malformed]]:
    rows, numbered, malformed = [], [], []
    for text, line in zip(texts, lines):
        try:
            cells = cells_of(text)
        except csv.Error as error:
            what = "a quote that is not closed in its line" if "unexpected end" in str(error) else f"broken: {error}"
            remedy = 'close it; a quote inside a cell is written ""'
            malformed.append(Malformed(line, text.index('"') + 1, what, remedy))
            continue
        if len(cells) == width:
            rows.append(cells)
            numbered.append(line)
        else:
            what = f"{several(len(cells), 'cell')}, but the header has {several(width, 'column')}"
            remedy = "write an empty cell for what is not given; decimal point, not comma"
            malformed.append(Malformed(line, 1, what, remedy))
    return [[row[k] for row in rows] for k in range(width)], numbered, malformed
