"""Row 109: The antenna 0.4 m behind the camera, without lever arm: shifts along the flight direction."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import Row, each, film


def behind(row: Row) -> Row:
    arm = -0.4 if row["image"].startswith("01") else 0.4
    return row | {"X": f"{float(row['X']) + arm:.3f}"}


def make(folder: Path) -> list[str] | None:
    film(folder, each("exterior.csv", behind))
    return None
