"""How the lines of a list are read: what separates the cells, where its header is, and what is said above it."""

import csv
import re
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import NamedTuple

from aatri.errors import InputError
from aatri.formats.lists.list_columns import ANGLES, ListColumns, columns_of_header
from aatri.formats.text.number_text import is_number
from aatri.formats.text.text_line import TextLine, words_of
from aatri.ids import several

NO_COLUMN = re.compile(r"(?:ellipsoid|ellipsoidal|orthometric)\s+(?=height)|(?<!\s)\s+(?=[(\[])", re.IGNORECASE)
"""Before a height or a unit: the second word of a header between blanks is no column of its own."""
UNITS = re.compile(r"\(\s*position in (\w+),\s*orientation in (deg|grad|gon|rad)", re.IGNORECASE)
"""The line of units that Applanix writes above its list."""
UNIT_WORDS = {"m": "m", "meter": "m", "meters": "m", "metre": "m", "metres": "m", "s": "s", "sec": "s", "seconds": "s",
              "deg": "deg", "degree": "deg", "degrees": "deg", "gon": "gon", "grad": "gon", "rad": "rad", "px": "px",
              "pixel": "px", "pixels": "px", "mm": "mm", "um": "um", "\u00b5m": "um", "cm": "cm", "km": "km",
              "ft": "ft", "feet": "ft"}  # fmt: skip
"""Units as a row below the header names them, or a name in it."""
OF_COLUMN = {**dict.fromkeys(("X", "Y", "Z", "sX", "sY", "sZ", "sXY"), ("m",)), "time": ("s",),
             **dict.fromkeys(("x", "y"), ("px", "mm")), **dict.fromkeys(("sx", "sy"), ("px", "mm", "um")),
             **dict.fromkeys(("longitude", "latitude"), ("deg",)),
             **dict.fromkeys(chain(*ANGLES.values()), ("deg", "gon", "rad"))}  # fmt: skip
"""Units that a column may have."""
UNIT_OF_NAME = re.compile(r"(?:_|[(\[]\s*)([^\W\d_]+)\s*[)\]]?$")
"""The unit at the end of the name of a column: `x_mm`, `x [mm]`."""
FEWEST, MOST = 3, 200
"""Columns that a list has at least, and names that a line may have to be its header."""
MOST_BEFORE = 50
"""A header stands within so many lines, after the preamble of a report."""


class ListForm(NamedTuple):
    """How a list is read: its columns, what separates its cells, and the line with its header (0: none)."""

    columns: ListColumns
    separator: str
    header: int


def cells(text: str, separator: str) -> list[str]:
    """The cells of a line."""
    if not separator:
        return [word.strip("\"'") for word in words_of(text)]
    return [cell.strip() for cell in next(csv.reader([text.strip("\r\n ")], delimiter=separator), [])]


def header_cells(text: str, separator: str) -> list[str]:
    """The names of the columns in a header."""
    return cells(NO_COLUMN.sub("", text).lstrip("# "), separator)


def separator_of(text: str, fewest: int = 1) -> str:
    """What separates the cells of a line, so that there are enough of them; empty: blanks."""
    signs = [sign for sign in "\t;," if sign in text]
    return next((sign for sign in signs if len(cells(text, sign)) >= fewest), "")


def proposed(lines: list[str]) -> ListForm | None:
    """How a list is read by its header; None without one."""
    for k, text in enumerate(lines[:MOST_BEFORE]):
        below = next((line for line in lines[k + 1 :] if line.strip() and not line.lstrip().startswith("#")), "")
        of_header = separator_of(text, FEWEST)
        names = header_cells(text, of_header)
        separator = separator_of(below, len(names)) or (of_header if of_header in below else "")
        columns = columns_of_header(names, cells(below, separator)) if below and FEWEST <= len(names) <= MOST else None
        if columns is not None:
            return ListForm(columns, separator, k + 1)
    return None


def form_of_columns(lines: list[str], columns: ListColumns, path: Path) -> ListForm:
    """Where the first row of stated columns is: the first line with numbers where numbers should be."""
    numbers = [k for k, name in enumerate(columns.names) if name not in ("-", "image", "point", "camera", "role")]
    for k, text in enumerate(lines[:MOST_BEFORE]):
        separator = separator_of(text, columns.fewest)
        row = TextLine(cells(text, separator), path, k + 1)
        if text.lstrip().startswith("#"):
            continue
        if len(row.words) < columns.fewest:
            if all(at < len(row.words) and is_number(row.words[at]) for at in numbers[:2]):
                raise row.error(
                    f"{several(len(row.words), 'word')}, for the columns {' '.join(columns.words)}", "mend the row"
                )
            continue
        if any(is_number(row.words[at]) for at in numbers if at < len(row.words)):
            return ListForm(columns, separator, k)
    what = f"no row has numbers where the columns {' '.join(columns.words)} have them"
    raise InputError(what, where=f"{path}:1", remedy="say the columns of the list, in their order")


def in_units_of(row: TextLine, columns: ListColumns) -> ListColumns | None:
    """The columns in the units of a row that has nothing but units and rules; None of a row of another kind."""
    units = [cell.strip("()[]").lower() for cell in row.words]
    if not any(units) or not all(unit in UNIT_WORDS or not unit.strip("-=_") for unit in units):
        return None
    for name, unit in zip(columns.names, units):
        stated = UNIT_WORDS.get(unit)
        if stated is None or name not in OF_COLUMN:
            continue
        if stated not in OF_COLUMN[name]:
            raise row.error(f"{name} in {unit}", f"export it in {' or '.join(OF_COLUMN[name])}")
        if name in ("x", "y", "sx", "sy"):
            columns = columns._replace(in_image={**columns.in_image, name: stated})
        elif len(OF_COLUMN[name]) > 1:
            columns = columns._replace(angle=stated)
    return columns


def in_units_of_names(heading: TextLine, columns: ListColumns) -> ListColumns:
    """The columns in the units that their names in the header end with."""
    ends = (UNIT_OF_NAME.search(name.strip().lower()) for name in heading.words)
    units = [end[1] if end and end[1] in UNIT_WORDS else "" for end in ends]
    return in_units_of(replace(heading, words=units), columns) or columns


def in_stated_units(columns: ListColumns, lines: list[str], path: Path) -> ListColumns:
    """The columns with the unit of angles that a line above the header states."""
    for k, text in enumerate(lines[:MOST_BEFORE], 1):
        if units := UNITS.search(text):
            if not units[1].lower().startswith("met"):
                raise InputError(f"positions in {units[1]}", where=f"{path}:{k}", remedy="export in metres")
            unit = units[2].lower()
            return columns._replace(angle={"grad": "gon"}.get(unit, unit))
    return columns


def stated_crs(lines: list[str]) -> str:
    """The coordinate system that Metashape writes above its lists."""
    stated = (re.match(r"#\s*CoordinateSystem:\s*(\S.*)", text) for text in lines[:5])
    text = next((heading.group(1).strip() for heading in stated if heading), "")
    return "" if text.lower().startswith("local") else text
