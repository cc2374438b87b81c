"""Row 82: A standard deviation of 1e-99 m."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import Row, each, film


def tiny(row: Row) -> Row:
    return row | {"sX": "1e-99", "sY": "1e-99"} if row["point"] == "GCP06" else row


def make(folder: Path) -> list[str] | None:
    film(folder, each("ground_points.csv", tiny), until="block")
    return None
