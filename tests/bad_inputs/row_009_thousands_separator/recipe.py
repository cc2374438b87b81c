"""Row 9: Blanks and underscores between thousands."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, replaced


def make(folder: Path) -> list[str] | None:
    block(
        folder, replaced("ground_points.csv", "4505279.577", "4 505 279"), replaced("image_points.csv", "10.5", "1_000")
    )
    return None
