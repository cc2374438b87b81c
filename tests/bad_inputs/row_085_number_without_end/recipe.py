"""Row 85: A coordinate of 40,000 digits."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, replaced


def make(folder: Path) -> list[str] | None:
    block(folder, replaced("ground_points.csv", "4505079.577", "4" * 40_000))
    return None
