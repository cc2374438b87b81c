"""Row 114: No check points."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.flown import each, film, is_control

SHOWN = "accuracy"


def make(folder: Path) -> list[str] | None:
    film(folder, each("ground_points.csv", lambda row: row if is_control(row) else None), until="accuracy")
    return None
