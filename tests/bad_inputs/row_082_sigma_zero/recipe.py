"""Row 82: A standard deviation of 0 on the image."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, replaced


def make(folder: Path) -> list[str] | None:
    block(folder, replaced("image_points.csv", "4,4", "0,4"))
    return None
