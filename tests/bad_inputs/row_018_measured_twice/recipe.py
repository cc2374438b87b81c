"""Row 18: One point measured twice in one image, with different results."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import added, block


def make(folder: Path) -> list[str] | None:
    block(folder, added("image_points.csv", "1,a1,11.5,20.25,,,,\n"))
    return None
