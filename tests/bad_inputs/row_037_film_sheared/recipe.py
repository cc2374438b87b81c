"""Row 37: Film that is wider than high by 0.2 per cent."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import film, scaled


def make(folder: Path) -> list[str] | None:
    film(
        folder,
        scaled("fiducials.csv", lambda row: row["image"] == "0103", x=1.002),
        scaled("image_points.csv", lambda row: row["image"] == "0103", x=1.002),
        until="interior",
    )
    return None
