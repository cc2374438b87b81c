"""Row 56: One position for all images, and no control beside it."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import each, film, without


def make(folder: Path) -> list[str] | None:
    film(
        folder,
        each("exterior.csv", lambda row: row | {"X": "446000.0", "Y": "4505000.0", "Z": "390.0"}),
        without("ground_points.csv"),
        until="absolute",
    )
    return None
