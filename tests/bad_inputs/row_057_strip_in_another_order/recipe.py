"""Row 57: The images of a strip listed in another order than they were flown."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import Row, each, film

ORDER = {"0101": "1", "0102": "3", "0103": "2", "0104": "4"}


def reordered(row: Row) -> Row:
    return row | {"sequence": ORDER.get(row["image"], row["sequence"])}


def make(folder: Path) -> list[str] | None:
    film(folder, each("images.csv", reordered), until="strips")
    return None
