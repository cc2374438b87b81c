"""Row 88: Strip polynomials of degree 4 with control for less."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import each, film, without


def make(folder: Path) -> list[str] | None:
    film(
        folder,
        without("exterior.csv"),
        each("ground_points.csv", lambda row: row if row["point"] in ("GCP01", "GCP02", "GCP03", "GCP04") else None),
        until="strip_block",
        strip_block="degree: 4",
    )
    return None
