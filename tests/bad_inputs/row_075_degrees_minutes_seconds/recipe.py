"""Row 75: Degrees, minutes, seconds for a coordinate."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, replaced


def make(folder: Path) -> list[str] | None:
    block(folder, replaced("ground_points.csv", "4505279.577", "40-41-12.5"))
    return None
