"""Row 15: Two columns of one name."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, replaced


def make(folder: Path) -> list[str] | None:
    block(folder, replaced("image_points.csv", "sx,sy", "sx,sx"))
    return None
