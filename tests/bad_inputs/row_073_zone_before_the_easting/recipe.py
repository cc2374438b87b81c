"""Row 73: Control with the number of its zone before the easting."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import each, film


def make(folder: Path) -> list[str] | None:
    film(folder, each("ground_points.csv", lambda row: row | {"X": "50" + row["X"]}))
    return None
