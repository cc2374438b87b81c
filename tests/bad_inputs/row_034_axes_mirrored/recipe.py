"""Row 34: Axes of a frame that are none."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, replaced


def make(folder: Path) -> list[str] | None:
    block(folder, replaced("block.yaml", "north, east, up", "north, south, up"))
    return None
