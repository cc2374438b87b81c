"""Row 106: Gross errors in five of a hundred image points."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import Row, film, moved


def is_hit(row: Row) -> bool:
    return (int(row["image"]) * 7 + sum(map(ord, row["point"])) * 13) % 20 == 0


def make(folder: Path) -> list[str] | None:
    film(folder, moved("image_points.csv", is_hit, x=0.4, y=-0.3), bundle="blunders: robust_snooping")
    return None
