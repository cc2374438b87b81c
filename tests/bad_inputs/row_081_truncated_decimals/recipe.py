"""Row 81: Positions without decimals, as some receivers write them."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import Row, each, film


def truncated(row: Row) -> Row:
    return row | {axis: f"{float(row[axis]) // 10 * 10:.0f}" for axis in ("X", "Y")}


def make(folder: Path) -> list[str] | None:
    film(folder, each("exterior.csv", truncated))
    return None
