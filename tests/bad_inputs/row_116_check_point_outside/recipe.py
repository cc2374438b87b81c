"""Row 116: A check point outside of the control."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import Row, each, film

SHOWN = "accuracy"


def outside(row: Row) -> Row:
    return row | {"role": "check"} if row["point"] == "GCP04" else row


def make(folder: Path) -> list[str] | None:
    film(folder, each("ground_points.csv", outside), until="accuracy")
    return None
