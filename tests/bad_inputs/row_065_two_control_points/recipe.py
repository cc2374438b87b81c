"""Row 65: Two control points and no positions: no datum."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import each, film, without


def make(folder: Path) -> list[str] | None:
    film(
        folder,
        without("exterior.csv"),
        each("ground_points.csv", lambda row: row if row["point"] in ("GCP01", "GCP04", "CHK01") else None),
        until="absolute",
        refined="refraction: false, earth_curvature: false",
    )
    return None
