"""Row 83: Standard deviations of image points a hundred times too small."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import every, film, scaled


def make(folder: Path) -> list[str] | None:
    film(folder, scaled("image_points.csv", every, sx=0.01, sy=0.01))
    return None
