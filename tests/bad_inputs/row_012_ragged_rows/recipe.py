"""Row 12: A row with too few, a row with too many cells."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import added, block


def make(folder: Path) -> list[str] | None:
    block(folder, added("image_points.csv", "1,a1,3\n2,a1,3,4,,,,,,\n"))
    return None
