"""Row 84: A point that is control and check."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import added, block


def make(folder: Path) -> list[str] | None:
    block(folder, added("ground_points.csv", "3,4505279.577,446563.976,8.1,,,,,control,\n"))
    return None
