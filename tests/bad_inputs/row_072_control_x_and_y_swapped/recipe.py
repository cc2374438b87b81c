"""Row 72: X and Y of all control swapped."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import Row, each, film


def swapped(row: Row) -> Row:
    return row | {"X": row["Y"], "Y": row["X"]}


def make(folder: Path) -> list[str] | None:
    film(folder, each("ground_points.csv", swapped))
    return None
