"""Row 26: 12:30:45 is no number."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, replaced


def make(folder: Path) -> list[str] | None:
    block(folder, replaced("block.yaml", "terrain_height: 6.1", "terrain_height: 12:30:45"))
    return None
