"""Row 76: Control in the coordinates of the next zone."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import every, film, moved


def make(folder: Path) -> list[str] | None:
    film(folder, moved("ground_points.csv", every, X=-512345.0, Y=-1234.0), until="absolute")
    return None
