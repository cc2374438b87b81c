"""Row 29: No unit of angles, and no default."""

from __future__ import annotations

from pathlib import Path

from tests.bad_inputs.kit import block, replaced


def make(folder: Path) -> list[str] | None:
    block(folder, replaced("block.yaml", "angle: gon, ", ""))
    return None
