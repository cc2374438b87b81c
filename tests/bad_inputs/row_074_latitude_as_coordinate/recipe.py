"""Row 74: Degrees with letters for a coordinate."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, replaced


def make(folder: Path) -> list[str] | None:
    block(folder, replaced("ground_points.csv", "4505279.577,446463.976", "40.7N,119.2E"))
    return None
