"""Row 106: Gross errors in five of a hundred image points."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import film, moved


def make(folder: Path) -> list[str] | None:
    film(
        folder,
        moved(
            "image_points.csv",
            lambda row: (int(row["image"]) * 7 + sum(map(ord, row["point"])) * 13) % 20 == 0,
            x=0.4,
            y=-0.3,
        ),
    )
    return None
