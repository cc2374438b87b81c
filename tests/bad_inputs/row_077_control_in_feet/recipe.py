"""Row 77: Control in feet, in a map."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import every, film, scaled


def make(folder: Path) -> list[str] | None:
    film(folder, scaled("ground_points.csv", every, X=1 / 0.3048, Y=1 / 0.3048, Z=1 / 0.3048), until="absolute")
    return None
