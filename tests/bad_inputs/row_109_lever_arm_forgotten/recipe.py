"""Row 109: The antenna 1.5 m behind the camera, without lever arm: shifts along the flight direction."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import film, moved


def make(folder: Path) -> list[str] | None:
    film(
        folder,
        moved("exterior.csv", lambda row: row["image"].startswith("01"), X=-1.5),
        moved("exterior.csv", lambda row: row["image"].startswith("02"), X=1.5),
    )
    return None
