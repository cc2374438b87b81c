"""A table of measurements that is changed row by row, while others may change it too.

A line of the file is a row; what was read of it is its version. A change names the line as it was seen: where the file
has another one by now, from another tab or an editor, nothing is written and the change is refused by name. All other
lines, comments, the order of columns, byte order mark and line ends stay as they are; the file is written whole or not
at all, under a lock of the folder that other programs of this kind share.
"""

import contextlib
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from aatri.errors import Faults, ResourceError, raise_all
from aatri.formats.tables.columns import TABLES
from aatri.formats.text.csv_cells import cells_of, shielded, unshielded
from aatri.formats.text.csv_table import read_csv
from aatri.formats.text.number_text import number_of
from aatri.formats.text.text_file import read_bytes, read_lines
from aatri.formats.text.written_files import write_files


class ChangedMeanwhile(ResourceError):
    """A row is no more as it was seen."""


@dataclass(frozen=True)
class MeasuredRow:
    """A row of image_points.csv or fiducials.csv."""

    image: str
    name: str
    """Of the point or mark."""
    xy: tuple[float, float]
    sigma: tuple[float, float]
    """As in the file; NaN where not given."""
    active: bool
    line: str
    """The line as it stands: the version of the row."""


class RowChange(NamedTuple):
    """A line that became another: empty before, it was added; empty after, it was taken out."""

    before: str
    after: str


class MeasuredTable:
    """image_points.csv or fiducials.csv of a block folder."""

    def __init__(self, path: Path, new_columns: tuple[str, ...]) -> None:
        """Read the table.

        Parameters
        ----------
        path : Path
            Need not be there.
        new_columns : tuple of str
            Header of a file that is not there yet.
        """
        self.path = path.resolve()
        self.columns = TABLES[path.name]
        self.named = "fiducial" if path.name == "fiducials.csv" else "point"
        self.new_columns = new_columns
        self._stamp: tuple[int, ...] | None = None
        self.refresh()

    def refresh(self) -> bool:
        """Read the file again if it is another than last time; whether it was.

        Raises
        ------
        InputError
            If it breaks the contract by now.
        """
        stamp = self._stamp_now()
        if stamp == self._stamp:
            return False
        self.header: tuple[str, ...] = self.new_columns
        self._lines: list[str] = [",".join(self.new_columns)]
        self._width = len(self.header)
        self._mark, self._end = b"", "\n"
        self._of: dict[str, dict[str, list[int]]] = {"image": {}, self.named: {}}
        if stamp:
            problems = Faults()
            table = read_csv(self.path, {name: stated.cell for name, stated in self.columns.items()}, problems)
            raise_all(problems)
            raw = read_bytes(self.path)
            self._mark, self._end = raw[:3] if raw[:3] == b"\xef\xbb\xbf" else b"", "\r\n" if b"\r\n" in raw else "\n"
            self.header, self._lines = table.header, read_lines(self.path)
            self._width = next(
                len(cells_of(line)) for line in self._lines if line.strip(", \t") and line.lstrip()[0] != "#"
            )
            for line, image, name in zip(table.line.tolist(), table.text["image"], table.text[self.named]):
                self._enter(line - 1, image, name)
        self._stamp = stamp
        return True

    def of_image(self, image: str) -> list[MeasuredRow]:
        """Rows of an image."""
        return [self._row(k) for k in self._of["image"].get(image, ())]

    def of_name(self, name: str) -> list[MeasuredRow]:
        """Rows of a point or mark."""
        return [self._row(k) for k in self._of[self.named].get(name, ())]

    def counts(self) -> dict[str, int]:
        """How many rows each point or mark has."""
        return {name: len(rows) for name, rows in self._of[self.named].items() if rows}

    def image_counts(self) -> dict[str, int]:
        """How many rows each image has."""
        return {name: len(rows) for name, rows in self._of["image"].items() if rows}

    def measure(self, image: str, name: str, before: str, cells: Mapping[str, str]) -> RowChange:
        """Write cells into the row that is `before`, or add one where that is empty.

        Raises
        ------
        ChangedMeanwhile
            If the row is another, or is there already.
        """
        with self._current():
            old = dict(zip(self.header, cells_of(before))) if before else {"image": shielded(image)}
            new = old | {self.named: shielded(name)} if not before else old
            new |= {column: cell for column, cell in cells.items() if column in self.header}
            cells_after = [_quoted(new.get(column, "")) for column in self.header]
            after = ",".join(cells_after + [""] * (self._width - len(cells_after)))
            return self._replace(image, name, RowChange(before, after))

    def remove(self, image: str, name: str, before: str) -> RowChange:
        """Take a row out."""
        with self._current():
            return self._replace(image, name, RowChange(before, ""))

    def undo(self, image: str, name: str, change: RowChange) -> RowChange:
        """Bring back what was before a change, if the row is still as the change left it."""
        with self._current():
            return self._replace(image, name, RowChange(change.after, change.before))

    def _replace(self, image: str, name: str, change: RowChange) -> RowChange:
        rows = self._of[self.named].get(name, [])
        of_key = [k for k in rows if k in self._of["image"].get(image, ())]
        at = next((k for k in of_key if self._lines[k] == change.before), None)
        if at is None and (change.before or of_key):
            now = " and ".join(f"x {self._row(k).xy[0]}, y {self._row(k).xy[1]}" for k in of_key) or "not there"
            what = f"{self.named} {name} in image {image} was changed meanwhile by another tab or program: it is {now}"
            raise ChangedMeanwhile(what, where=str(self.path), remedy="look at it and measure again")
        lines = self._lines.copy()
        if not change.after:
            lines.pop(at or 0)
        elif at is None:
            lines.append(change.after)
        else:
            lines[at] = change.after
        text = self._end.join(lines) + self._end
        write_files(self.path.parent, {self.path.name: self._mark + text.encode("utf-8")})
        if change.before and change.after:
            self._lines, self._stamp = lines, self._stamp_now()
        elif at is None:
            self._enter(len(self._lines), image, name)
            self._lines, self._stamp = lines, self._stamp_now()
        else:
            self.refresh()  # the lines below have moved up
        return change

    def _enter(self, at: int, image: str, name: str) -> None:
        for column, cell in (("image", image), (self.named, name)):
            self._of[column].setdefault(cell, []).append(at)

    def _row(self, at: int) -> MeasuredRow:
        line = self._lines[at]
        cells = dict(zip(self.header, map(unshielded, cells_of(line))))
        x, y, sx, sy = (number_of(c) if (c := cells.get(n, "")) else float("nan") for n in ("x", "y", "sx", "sy"))
        active = cells.get("active", "").lower() not in ("no", "false", "0")
        return MeasuredRow(cells["image"], cells[self.named], (x, y), (sx, sy), active, line)

    def _stamp_now(self) -> tuple[int, ...]:
        try:
            s = self.path.stat()
        except FileNotFoundError:
            return ()
        return s.st_mtime_ns, s.st_size, s.st_ino

    @contextlib.contextmanager
    def _current(self) -> Iterator[None]:
        """Hold the folder, with the table as it is now."""
        with _held(self.path.parent):
            self.refresh()
            yield


def _quoted(cell: str) -> str:
    return '"' + cell.replace('"', '""') + '"' if set(cell) & {",", '"'} else cell


@contextlib.contextmanager
def _held(folder: Path) -> Iterator[None]:
    """A lock of the kernel's on a folder; where there are none, of the system or the disk, work goes on without."""
    try:
        import fcntl
    except ImportError:
        yield
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        with contextlib.suppress(OSError):
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)
