"""Row 94: No control and no positions."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import film, without


def make(folder: Path) -> list[str] | None:
    film(
        folder,
        without("exterior.csv"),
        without("ground_points.csv"),
        until="absolute",
        refined="refraction: false, earth_curvature: false",
    )
    return None
