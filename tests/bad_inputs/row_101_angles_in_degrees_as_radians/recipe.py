"""Row 101: Attitudes in degrees, declared as radians."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import Row, digital, each


def turned(row: Row) -> Row:
    return row | {"a1": "0.4", "a2": "-0.3", "a3": "90" if row["image"].startswith("02") else "-90"}


def make(folder: Path) -> list[str] | None:
    digital(folder, each("exterior.csv", turned), until="absolute")
    return None
