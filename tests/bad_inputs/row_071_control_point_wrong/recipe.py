"""Row 71: One control point 2 m off."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import film, moved


def make(folder: Path) -> list[str] | None:
    film(folder, moved("ground_points.csv", lambda row: row["point"] == "GCP06", X=2.0))
    return None
