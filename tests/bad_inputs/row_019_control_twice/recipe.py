"""Row 19: A control point with two coordinates."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import added, block


def make(folder: Path) -> list[str] | None:
    block(folder, added("ground_points.csv", "K,1,2,3,1,1,1,,,\n"))
    return None
