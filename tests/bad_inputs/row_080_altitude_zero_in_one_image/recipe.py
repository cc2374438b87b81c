"""Row 80: A height of 0 in one image."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import each, film


def make(folder: Path) -> list[str] | None:
    film(folder, each("exterior.csv", lambda row: row | {"Z": "0"} if row["image"] == "0103" else row))
    return None
