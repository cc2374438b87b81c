"""Row 77: Only the heights of the control in feet, and no positions to hold them against."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import every, film, scaled, without


def make(folder: Path) -> list[str] | None:
    heights = scaled("ground_points.csv", every, Z=1 / 0.3048)
    film(folder, heights, without("exterior.csv"), until="absolute")
    return None
