"""Row 34: Film scanned from its back: all x mirrored."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import every, film, scaled


def make(folder: Path) -> list[str] | None:
    film(
        folder,
        scaled("fiducials.csv", every, x=-1.0),
        scaled("image_points.csv", every, x=-1.0),
        until="interior",
    )
    return None
