"""Row 41: Pixels without the size of the image."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, replaced


def make(folder: Path) -> list[str] | None:
    block(folder, replaced("block.yaml", "    format: [6000, 4000]\n", ""))
    return None
