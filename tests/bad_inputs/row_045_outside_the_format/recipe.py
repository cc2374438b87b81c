"""Row 45: Image points far outside the image."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, replaced


def make(folder: Path) -> list[str] | None:
    block(folder, replaced("image_points.csv", "3000,2000", "30000,2000"))
    return None
