"""Row 78: Positions with ellipsoidal heights, control above the geoid."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import every, film, moved


def make(folder: Path) -> list[str] | None:
    film(folder, moved("exterior.csv", every, Z=31.4))
    return None
