"""Row 8: A decimal comma that makes one more cell."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, replaced


def make(folder: Path) -> list[str] | None:
    block(folder, replaced("image_points.csv", "10.5,", "10,5,"))
    return None
