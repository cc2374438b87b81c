"""Row 66: Three control points on one line and no positions."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import each, film, without


def make(folder: Path) -> list[str] | None:
    film(
        folder,
        without("exterior.csv"),
        each("ground_points.csv", lambda row: row if row["point"] in ("GCP01", "GCP05", "GCP02") else None),
        until="absolute",
        refined="refraction: false, earth_curvature: false",
    )
    return None
