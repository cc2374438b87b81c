"""Row 56: One position for all images, from a receiver that had none."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import each, film


def make(folder: Path) -> list[str] | None:
    film(
        folder,
        each("exterior.csv", lambda row: row | {"X": "446000.0", "Y": "4505000.0", "Z": "390.0"}),
        until="absolute",
    )
    return None
