"""Row 83: Standard deviations of control written in mm, taken as m."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import every, film, scaled


def make(folder: Path) -> list[str] | None:
    film(folder, scaled("ground_points.csv", every, sX=1000.0, sY=1000.0, sZ=1000.0))
    return None
