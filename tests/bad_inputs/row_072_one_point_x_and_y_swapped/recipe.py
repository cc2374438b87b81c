"""Row 72: X and Y of one control point swapped."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import Row, each, film


def swapped(row: Row) -> Row:
    return row | {"X": row["Y"], "Y": row["X"]} if row["point"] == "GCP02" else row


def make(folder: Path) -> list[str] | None:
    film(folder, each("ground_points.csv", swapped))
    return None
