"""Row 69: A control point that no image shows: set aside, named."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import added, block


def make(folder: Path) -> list[str] | None:
    block(folder, added("ground_points.csv", "Q,4505000,446000,7,1,1,1,,,\n"))
    return None
