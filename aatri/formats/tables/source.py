"""What the readers of the tables of one block folder share: settings, files, ids and the list of faults."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import repeat
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from aatri.arrays import Bool, Float, Int
from aatri.errors import Faults
from aatri.formats.limits import MOST_RAD
from aatri.formats.tables.columns import TABLES, Stated, components
from aatri.formats.tables.settings.block import Settings
from aatri.formats.text.csv_table import MOST_PER_COLUMN, CsvTable, read_csv
from aatri.formats.text.number_text import number_of, rad_from_dms
from aatri.ids import clipped, did_you_mean, several
from aatri.progress import SILENT, Reporter
from aatri.strict_yaml import Document
from aatri.units import ANGLE_RAD

FILES = ("block.yaml", *TABLES, "relative_control.yaml")

EDITS = "edits.yaml"
"""Of a block folder: applied after reading, by `formats.edits`."""

COUNTED_LATER = ("image_points.csv", "geodetic.csv")
"""Tables of measurements, whose copies every format may have: `copies` finds them."""

YES_NO = {"yes": True, "true": True, "1": True, "no": False, "false": False, "0": False}


@dataclass(frozen=True)
class Source:
    """A block folder being read."""

    folder: Path
    settings: Settings
    document: Document
    reporter: Reporter = SILENT
    problems: Faults = field(default_factory=Faults)
    default_frame: int = 0  # of rows that name none: 1 where a map was put before a frame in degrees
    levelled: set[str] = field(default_factory=set)  # frames whose ellipsoidal heights the undulation has levelled

    def table(self, name: str, columns: Mapping[str, Stated] | None = None) -> CsvTable | None:
        """A table of the folder; None if it is not there or its header is wrong (then the fault is kept)."""
        cells = {column: stated.cell for column, stated in (columns or TABLES[name]).items()}
        path = self.folder / name
        if not os.path.lexists(path):
            return None
        with self.problems.kept():
            table = read_csv(path, cells, self.problems, self.reporter)
            return table if name in COUNTED_LATER else self._without_copies(table)
        return None

    def _without_copies(self, table: CsvTable) -> CsvTable:
        """The table without rows whose cells are all those of an earlier row."""
        first: dict[tuple[object, ...], int] = {}
        columns = [*table.text.values(), *(map(repr, column.tolist()) for column in table.number.values())]
        of_row = [first.setdefault(cells, k) for k, cells in enumerate(zip(*columns))]
        copies = [k for k, earlier in enumerate(of_row) if earlier != k]
        if not copies:
            return table
        lines = ", ".join(str(table.line[k]) for k in copies[:MOST_PER_COLUMN])
        more = ", ..." if len(copies) > MOST_PER_COLUMN else ""
        self.reporter.warn(
            f"{table.where(copies[0])}: {several(len(copies), 'row', 'repeats', 'repeat')} an earlier "
            f"one in every digit, counted once: line {lines}{more}"
        )
        return table.taken(sorted(first.values()))

    def columns(self, table: CsvTable, declared: Mapping[str, Stated]) -> dict[str, Any]:
        """Columns of the Block that the cells of a table fill by themselves, and where its rows stand."""
        values = {
            name: self._values(table, name, stated)
            for name, stated in declared.items()
            if stated.field and stated.unit not in ("angle", "type")
        }
        place = {"file": FILES.index(table.path.name)} if table.path.name in FILES else {}
        return components({name: declared[name] for name in values}, values) | {"line": table.line, **place}

    def _values(self, table: CsvTable, name: str, stated: Stated) -> Any:
        if stated.cell.kind == "number":
            return table.number[name] * (getattr(self.settings.units, stated.unit) if stated.unit else 1.0)
        if stated.words:
            words = choice(table, name, tuple(stated.words), next(iter(stated.words)))
            return [stated.words.get(word) for word in words]
        return table.text[name] if stated.empty is None else yes_no(table, name, stated.empty)


def look_up(table: CsvTable, column: str, row_of: Mapping[str, int], what: str, remedy: str) -> Int:
    """Rows of the ids in a column; -1 where empty. Each unknown id is a fault at its first place, with its count."""
    cells = table.text[column]
    rows = np.fromiter(map(row_of.get, cells, repeat(-1)), dtype=np.int32, count=len(cells))
    first: dict[str, tuple[int, int]] = {}
    for k in np.flatnonzero(rows < 0).tolist():
        if cells[k]:
            start, count = first.get(cells[k], (k, 0))
            first[cells[k]] = (start, count + 1)
    for name, (k, count) in list(first.items())[:MOST_PER_COLUMN]:
        often = f", in {count} rows" if count > 1 else ""
        message = f"{what} {clipped(name)!r} is unknown{often}{did_you_mean(name, row_of)}"
        table.problems.add(message, table.where(k, column), remedy)
    if len(first) > MOST_PER_COLUMN:
        more = f"{several(len(first) - MOST_PER_COLUMN, 'more unknown id')} in column {column}"
        table.problems.add(more, str(table.path), remedy)
    return rows


def yes_no(table: CsvTable, column: str, default: bool) -> Bool:
    """A truth column: yes or no; `default` where empty."""
    cells = table.text[column]
    if not any(cells):
        return np.full(len(table), default)
    values = [YES_NO.get(cell.lower()) if cell else default for cell in cells]
    table.complain([k for k, v in enumerate(values) if v is None], column, f"{column} is {{}}", "write yes or no")
    return np.array([bool(v) for v in values], dtype=bool)


def choice(table: CsvTable, column: str, allowed: Sequence[str], default: str) -> list[str]:
    """A column of fixed words; `default` where empty."""
    cells = [cell or default for cell in table.text[column]]
    for word in sorted(set(cells) - set(allowed)):
        rows = [k for k, cell in enumerate(cells) if cell == word]
        what = f"{column} is {{}}{did_you_mean(word, allowed)}"
        table.complain(rows, column, what, f"it is one of {', '.join(allowed)}")
    return cells


def no_repeats(table: CsvTable, columns: Sequence[str], what: str) -> None:
    """A fault for each row whose ids were in an earlier row, naming that one."""
    first: dict[tuple[str, ...], int] = {}
    for k, key in enumerate(zip(*(table.text[name] for name in columns))):
        earlier = first.setdefault(key, k)
        if earlier != k and all(key):
            name = clipped("/".join(key))
            message = f"{what} {name!r} twice, first in line {table.line[earlier]}"
            table.problems.add(message, table.where(k, columns[0]), "remove or rename one")


def not_negative(table: CsvTable, column: str, *, zero: bool) -> None:
    """A fault for each standard deviation below zero, or zero where that is not allowed."""
    values = table.number[column]
    bad = values < 0 if zero else values <= 0
    limit = "0 (exact) or more" if zero else "more than 0"
    table.complain(np.flatnonzero(bad), column, f"{column} is {{}}", f"a standard deviation is {limit}")


def angles_rad(source: Source, table: CsvTable, column: str, rows: npt.ArrayLike | None = None) -> Float:
    """A column of angles in the block's unit, in radians; NaN where empty."""
    unit = source.settings.units.angle
    cells = table.text[column]
    values = np.full(len(table), np.nan)
    chosen = np.arange(len(table)) if rows is None else np.asarray(rows, dtype=np.intp)
    bad = []
    for k in chosen.tolist():
        if cells[k]:
            try:
                values[k] = rad_of(cells[k], unit)
            except ValueError:
                bad.append(k)
    if unit == "dms":
        form = "degrees, minutes and seconds like 12-30-45.5"
        table.complain(bad, column, f"{column} is {{}}, not an angle", f"write it as {form}")
    else:
        table.complain_of_numbers(bad, column)
    if unit == "rad":
        turns = np.flatnonzero(np.abs(np.nan_to_num(values)) > MOST_RAD)
        table.complain(
            turns,
            column,
            f"{column} is {{}} rad, more than two turns: degrees or gon?",
            "set units: {angle: deg} (or gon) in block.yaml, if all angles are so",
        )
    if any(cells[k] for k in chosen):
        ask_for_angle_unit(source, f"{table.path.name} has angles in column {column}", "units")
    return values


def plain_angle_rad(source: Source) -> float:
    """Factor of plain angles in block.yaml; degrees where tables have degrees, minutes and seconds."""
    unit = source.settings.units.angle
    return ANGLE_RAD["deg" if unit == "dms" else unit or "rad"]


def ask_for_angle_unit(source: Source, because: str, *keys: str) -> None:
    """A fault at a place of block.yaml that has angles, if the file does not say in which unit."""
    if source.settings.units.angle is None:
        source.problems.add(
            f"units.angle is missing, but {because}",
            source.document.where(*keys),
            "add units: {angle: deg} (or gon, rad, dms)",
        )


def rad_of(text: str, unit: str | None) -> float:
    """An angle in radians.

    Raises
    ------
    ValueError
        If the text is no angle of this unit.
    """
    if unit != "dms":
        return number_of(text) * ANGLE_RAD[unit or "rad"]
    return rad_from_dms(text)
