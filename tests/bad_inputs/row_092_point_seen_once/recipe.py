"""Row 92: A point seen in one image."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import film, more


def make(folder: Path) -> list[str] | None:
    film(folder, more("image_points.csv", "0101,lonely,150,150,0.005,0.005\n"))
    return None
