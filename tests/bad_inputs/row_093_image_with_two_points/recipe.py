"""Row 93: An image with two points."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import each, film


def make(folder: Path) -> list[str] | None:
    film(
        folder,
        each(
            "image_points.csv",
            lambda row: None if row["image"] == "0104" and row["point"] not in ("119", "121") else row,
        ),
        block="max_reject_share: 0.3",
    )
    return None
