"""Row 85: A coordinate of 1e308."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, replaced


def make(folder: Path) -> list[str] | None:
    block(folder, replaced("ground_points.csv", "4505079.577", "1e308"))
    return None
