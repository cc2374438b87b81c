"""Where an imported row was read, for messages."""

from typing import Protocol

from aatri.arrays import Int
from aatri.artifacts.block import Block, Geodetic


class Imported(Protocol):
    """A table whose rows keep their file and line."""

    @property
    def file(self) -> Int:
        """Row in files of each; -1 if it was not imported."""

    @property
    def line(self) -> Int:
        """Line in the file, from 1."""


def read_at(block: Block, rows: Imported, row: int) -> str:
    """`file:line` of a row of a table of the Block, the file of one that has no lines; empty if it was not imported."""
    file, line = int(rows.file[row]), int(rows.line[row])
    return "" if file < 0 else f"{block.files.path[file]}:{line}" if line > 0 else str(block.files.path[file])


def sight_name(rows: Geodetic, k: int) -> str:
    """How a geodetic observation is called in messages and rejects."""
    return f"{rows.type[k]} {rows.start[k]} {rows.end[k]}"
