"""Row 91: A tie point that is another point in the second strip."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import Row, film, moved


def is_wrong(row: Row) -> bool:
    return row["image"].startswith("02") and row["point"] == "124"


def make(folder: Path) -> list[str] | None:
    film(folder, moved("image_points.csv", is_wrong, x=3.0, y=2.0), until="strip_block")
    return None
