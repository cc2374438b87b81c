"""Row 68: A control point that one image shows, and one that none shows."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import each, film, more


def make(folder: Path) -> list[str] | None:
    film(
        folder,
        each("image_points.csv", lambda row: None if row["point"] == "GCP05" and row["image"] != "0103" else row),
        more("ground_points.csv", "GCP99,446100,4505100,7,0.01,0.01,0.015,control\n"),
    )
    return None
