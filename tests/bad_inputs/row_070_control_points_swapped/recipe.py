"""Row 70: The labels of two control points swapped."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import Row, each, film


def swapped(row: Row) -> Row:
    return row | {"point": {"GCP05": "GCP08", "GCP08": "GCP05"}.get(row["point"], row["point"])}


def make(folder: Path) -> list[str] | None:
    film(folder, each("ground_points.csv", swapped))
    return None
