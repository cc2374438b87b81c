"""Row 72: X and Y of all control swapped, in a local system."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import Row, digital, each


def swapped(row: Row) -> Row:
    return row | {"X": row["Y"], "Y": row["X"]}


def make(folder: Path) -> list[str] | None:
    digital(folder, each("ground_points.csv", swapped), until="absolute")
    return None
