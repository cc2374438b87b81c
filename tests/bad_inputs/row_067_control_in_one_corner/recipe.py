"""Row 67: All control within one corner of the block."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import each, film, without


def make(folder: Path) -> list[str] | None:
    film(
        folder,
        without("exterior.csv"),
        each("ground_points.csv", lambda row: row if row["point"] in ("GCP01", "GCP05", "GCP06") else None),
    )
    return None
